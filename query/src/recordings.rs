//! The table `recordings`: a row for each recording, from the index of its file.

use std::sync::Arc;

use arrow::array::{ArrayRef, Int64Array, RecordBatch, StringArray, UInt64Array};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use datafusion::error::Result;
use tauscope_archive::Recording;
use tauscope_pipeline::replay::stem;

use crate::scan::{Counts, Listed, Scan, open};

/// Rows of a batch.
/// Resolution: latency of the first rows, against the cost of a batch.
const BATCH_ROWS: usize = 256;

/// Schema of the table.
pub(crate) fn schema() -> SchemaRef {
    let text = |name| Field::new(name, DataType::Utf8, false);
    let stamp = |name| Field::new(name, DataType::Int64, true);
    let count = |name| Field::new(name, DataType::UInt64, false);
    Arc::new(Schema::new(vec![
        text("recording"),
        text("path"),
        text("kind"),
        stamp("log_start_ns"),
        stamp("log_end_ns"),
        count("messages"),
        count("bytes"),
        count("chunks"),
        count("damages"),
    ]))
}

/// Passes a row for each recording on.
pub(crate) fn read(
    listed: &[Listed],
    scan: &Scan,
    counts: &Counts,
    give: &mut dyn FnMut(RecordBatch) -> bool,
) -> Result<()> {
    for some in listed.chunks(BATCH_ROWS) {
        let rows = some
            .iter()
            .map(|one| open(one, counts))
            .collect::<Result<Vec<_>>>()?;
        let batch = batch(&rows)?;
        let batch = match &scan.projection {
            Some(columns) => batch.project(columns)?,
            None => batch,
        };
        if !give(batch) {
            break;
        }
    }
    Ok(())
}

fn batch(rows: &[Recording]) -> Result<RecordBatch> {
    let texts = |text: fn(&Recording) -> String| {
        Arc::new(
            rows.iter()
                .map(|row| Some(text(row)))
                .collect::<StringArray>(),
        ) as ArrayRef
    };
    let stamps = |stamp: fn(&Recording) -> Option<i64>| {
        Arc::new(rows.iter().map(stamp).collect::<Int64Array>()) as ArrayRef
    };
    let numbers = |count: fn(&Recording) -> u64| {
        Arc::new(
            rows.iter()
                .map(|row| Some(count(row)))
                .collect::<UInt64Array>(),
        ) as ArrayRef
    };
    Ok(RecordBatch::try_new(
        schema(),
        vec![
            texts(|row| stem(row.path())),
            texts(|row| row.path().display().to_string()),
            texts(|row| row.kind().to_string()),
            stamps(Recording::start_ns),
            stamps(Recording::end_ns),
            numbers(Recording::message_count),
            numbers(Recording::bytes),
            numbers(Recording::chunks),
            numbers(|row| row.damage().len() as u64),
        ],
    )?)
}
