//! What is read of which recordings, as plain data, and what all who read have in common.

use std::path::PathBuf;
use std::sync::Arc;

use arrow::datatypes::SchemaRef;
use datafusion::error::{DataFusionError, Result};
use datafusion::physical_plan::metrics::Count;
use serde::{Deserialize, Serialize};
use tauscope_archive::Recording;

use crate::asked::Asked;

/// What is read from recordings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A row for each recording.
    Recordings,
    /// A row for each joint of each joint state.
    Joints,
    /// The rows of `docs/results.md`.
    Replay {
        /// The pipeline file.
        pipeline: PathBuf,
        /// The stage whose place the recordings take, where the pipeline has several sources.
        source: Option<String>,
        /// Hash of all that the results depend on but for the recording
        /// ([`Identity::hash`](results::Identity::hash)): whoever replays checks that it has the same.
        identity: String,
    },
}

/// A recording as a plan names it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Listed {
    /// From the root of the file system.
    pub path: PathBuf,
    /// Its size when the query was planned, checked where it is read; 0 for a folder, of which it is not.
    pub bytes: u64,
}

/// What is read of which recordings: plain data, which a plan carries to another machine.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scan {
    /// What is read.
    pub kind: Kind,
    /// The recordings of each partition.
    pub partitions: Vec<Vec<Listed>>,
    /// Recordings of the table that the query does not ask for.
    pub skipped: usize,
    /// What the query asks for.
    pub asked: Asked,
    /// The columns, by their place; `None` for all.
    pub projection: Option<Vec<usize>>,
    /// Rows of a partition after which no more are wanted.
    pub limit: Option<usize>,
}

impl Scan {
    /// Those of all columns that are asked for.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn projected(&self, all: &SchemaRef) -> Result<SchemaRef> {
        Ok(match &self.projection {
            Some(columns) => Arc::new(all.project(columns)?),
            None => Arc::clone(all),
        })
    }
}

/// What `EXPLAIN ANALYZE` counts.
pub(crate) struct Counts {
    /// Recordings that were opened.
    pub(crate) opened: Count,
    /// Chunks that were read and unpacked.
    pub(crate) chunks_read: Count,
    /// Chunks of the opened recordings that were not.
    pub(crate) chunks_skipped: Count,
}

/// Opens a recording that is still what the plan names.
///
/// # Errors
/// If it cannot be opened, or has another size by now.
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

/// An error that `DataFusion` hands on.
pub(crate) fn external(
    error: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> DataFusionError {
    DataFusionError::External(error.into())
}
