//! Description of a scan of recordings as plain data, and the functions that all scans share.

use std::path::PathBuf;
use std::sync::Arc;

use arrow::datatypes::SchemaRef;
use datafusion::error::{DataFusionError, Result};
use datafusion::physical_plan::metrics::Count;
use serde::{Deserialize, Serialize};
use tauscope_archive::Recording;

use crate::asked::Asked;

/// Kind of rows read from recordings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A row for each recording.
    Recordings,
    /// A row for each joint of each joint state.
    Joints,
    /// The rows described in `docs/results.md`, from a replay.
    Replay {
        /// The pipeline file.
        pipeline: PathBuf,
        /// Source stage that the recordings replace, if the pipeline has several.
        source: Option<String>,
        /// Hash of everything that the results depend on except the recording
        /// ([`Identity::hash`](results::Identity::hash)). The executor compares it with its own.
        identity: String,
    },
}

/// A recording in a plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// Absolute path.
    pub path: PathBuf,
    /// Size when the query was planned, checked before reading; 0 for a folder, which is not checked.
    pub bytes: u64,
}

/// A scan of recordings: plain data that a plan carries to another machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// Kind of the rows.
    pub kind: Kind,
    /// The recordings of each partition.
    pub partitions: Vec<Vec<Listed>>,
    /// Number of recordings of the table that the query does not need.
    pub skipped: usize,
    /// Bound on the rows, from the filters of the query.
    pub asked: Asked,
    /// Indices of the projected columns; `None` for all.
    pub projection: Option<Vec<usize>>,
    /// Number of rows per partition after which reading stops.
    pub limit: Option<usize>,
}

impl Scan {
    /// Schema of the projected columns.
    ///
    /// # Errors
    /// If a projected column does not exist.
    pub fn projected(&self, all: &SchemaRef) -> Result<SchemaRef> {
        Ok(match &self.projection {
            Some(columns) => Arc::new(all.project(columns)?),
            None => Arc::clone(all),
        })
    }
}

/// Counters of `EXPLAIN ANALYZE`.
pub(crate) struct Counts {
    /// Recordings that were opened.
    pub(crate) opened: Count,
    /// Chunks that were read and decompressed.
    pub(crate) chunks_read: Count,
    /// Chunks of the opened recordings that were skipped.
    pub(crate) chunks_skipped: Count,
}

/// Opens a recording, checking that it has not changed since the query was planned.
///
/// # Errors
/// If it cannot be opened, or its size has changed.
pub(crate) fn open(listed: &Listed, counts: &Counts) -> Result<Recording> {
    let recording = tauscope_session::open(&listed.path).map_err(external)?;
    if listed.bytes != 0 && recording.bytes() != listed.bytes {
        let path = listed.path.display();
        return Err(external(format!(
            "{path}: it has {} bytes, and had {} when the query was planned: ask again",
            recording.bytes(),
            listed.bytes
        )));
    }
    counts.opened.add(1);
    Ok(recording)
}

/// Wraps an error for `DataFusion`.
pub(crate) fn external(
    error: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> DataFusionError {
    DataFusionError::External(error.into())
}
