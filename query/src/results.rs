//! The tables of results: views over one table of all their rows.

use std::path::PathBuf;

use datafusion::error::Result;
use datafusion::prelude::{ParquetReadOptions, SessionContext};
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::results::schema;

/// The table of all rows.
const ALL: &str = "results";

/// Each view: name, value of the column `row`, and columns.
const VIEWS: [(&str, &str, &str); 5] = [
    (
        "replays",
        "recording",
        "recording, recording_sha256, cell, effort_unit, t_ns, end_ns, duration_s, samples, lost_samples, events",
    ),
    (
        "residuals",
        "residual",
        "recording, recording_sha256, cell, stage, joint, effort_unit, t_ns, end_ns, samples, moving_samples, \
         residual_rms, residual_rms_moving, filtered_residual_rms",
    ),
    (
        "events",
        "event",
        "recording, recording_sha256, cell, stage, detector, kind, link, joints, t_ns, end_ns, contact_ns, duration_s, \
         score, force_x_n, force_y_n, force_z_n",
    ),
    (
        "physics",
        "physics",
        "recording, recording_sha256, cell, stage, detector, kind, link, joints, t_ns, end_ns, contact_ns, duration_s, \
         score, size, size_unit",
    ),
    (
        "detections",
        "detection",
        "recording, recording_sha256, cell, stage, detector, kind, link, t_ns, score, threshold, alarm, ready, \
         force_x_n, force_y_n, force_z_n",
    ),
];

/// The names of the tables.
pub(crate) fn names() -> impl Iterator<Item = &'static str> {
    VIEWS.iter().map(|(name, ..)| *name).chain([ALL])
}

/// Registers the views over these files.
///
/// # Errors
/// If a file cannot be read.
pub(crate) async fn register(context: &SessionContext, files: &[PathBuf]) -> Result<(), Report> {
    if files.is_empty() {
        return Ok(());
    }
    let registered = over(context, files).await;
    registered.map_err(|error| Problem::new(format!("the results cannot be read: {error}")).into())
}

async fn over(context: &SessionContext, files: &[PathBuf]) -> Result<()> {
    let paths: Vec<String> = files
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let schema = schema();
    let options = ParquetReadOptions::default().schema(&schema);
    let all = context.read_parquet(paths, options).await?;
    context.register_table(ALL, all.into_view())?;
    for (name, row, columns) in VIEWS {
        let sql = format!("CREATE VIEW {name} AS SELECT {columns} FROM {ALL} WHERE row = '{row}'");
        context.sql(&sql).await?.collect().await?;
    }
    Ok(())
}
