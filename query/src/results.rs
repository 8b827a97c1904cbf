//! The tables of results: views over one table of all their rows.

use std::path::{Path, PathBuf};

use datafusion::error::Result;
use datafusion::prelude::{ParquetReadOptions, SessionContext};
use tauscope_pipeline::results::{parquet_files, schema};

/// Each table: its name, the value of the column `row`, and its columns.
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

/// Registers the tables over these folders and files.
///
/// # Errors
/// If a folder cannot be read.
pub async fn register(context: &SessionContext, paths: &[PathBuf]) -> anyhow::Result<()> {
    let mut files = Vec::new();
    for path in paths {
        files.extend(parquet_files(path)?);
    }
    if files.is_empty() {
        return Ok(());
    }
    let paths: Vec<String> = files.iter().map(|path| url(path)).collect();
    let schema = schema();
    let options = ParquetReadOptions::default().schema(&schema);
    let all = context.read_parquet(paths, options).await?;
    context.register_table("results", all.into_view())?;
    for (name, row, columns) in VIEWS {
        let sql = format!("CREATE VIEW {name} AS SELECT {columns} FROM results WHERE row = '{row}'");
        run(context, &sql).await?;
    }
    Ok(())
}

fn url(path: &Path) -> String {
    std::path::absolute(path)
        .unwrap_or_else(|_| path.to_owned())
        .display()
        .to_string()
}

async fn run(context: &SessionContext, sql: &str) -> Result<()> {
    context.sql(sql).await?.collect().await?;
    Ok(())
}
