//! Surroundings of a stage from which its node is created: live and in a replay.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tauscope_bus::{LinkError, SampleKind};
use tauscope_ingest::Findings;

use crate::build::BuildError;
use crate::cell::Cell;
use crate::pipeline::Pipeline;
use crate::report::Report;

/// Reason why the node of a stage cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// A stage without a cell.
    #[error("the stage has no cell")]
    NoCell,
    /// An external program, which is no node of ours.
    #[error("an `outside` stage is a program of its own")]
    Program,
    /// An unreadable state file.
    #[error("what was learnt cannot be read:\n{0}")]
    LearntState(Report),
    /// An invalid robot of a simulated source.
    #[error(transparent)]
    Model(#[from] tauscope_dynamics::ModelError),
    /// Settings that do not fit the cell.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// An unreadable source.
    #[error(transparent)]
    Ingest(#[from] tauscope_ingest::IngestError),
    /// An output that cannot be created.
    #[error(transparent)]
    Record(#[from] tauscope_record::RecordError),
    /// Endpoints of a publisher that cannot be opened.
    #[error(transparent)]
    Publish(#[from] tauscope_publish::PublishError),
    /// Endpoints for commands that cannot be opened.
    #[error("cannot take commands: {0}")]
    Commands(LinkError),
}

impl NodeError {
    /// Whether the error is in the arguments or input files.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Ingest(error) => error.is_input(),
            Self::Record(_) | Self::Publish(_) | Self::Commands(_) => false,
            _ => true,
        }
    }
}

/// Properties of a stream for its receivers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StreamFacts {
    /// The stage that emits it.
    pub stage: String,
    /// Its cell.
    pub cell: String,
    /// Sample type.
    pub kind: SampleKind,
    /// The detector, if it is a built-in one.
    pub detector: Option<String>,
    /// Whether its detections, if it emits any, are contacts.
    pub judges_contact: bool,
}

/// Surroundings of a stage in a running pipeline.
pub struct LiveSite<'a> {
    /// Name of the stage.
    pub stage: &'a str,
    /// Its cells.
    pub cells: &'a [Cell],
    /// Number of restarts.
    pub restarts: u64,
    /// Stamp of the last emitted sample, for a source that is restarted \[ns\].
    pub after_ns: Option<i64>,
    /// Whether any stage of its cell learns on request.
    pub somebody_learns: bool,
    /// Its input streams, for a stage that hears health.
    pub streams: &'a [StreamFacts],
    /// Provenance of the archive, for a stage that hears health.
    pub provenance: &'a BTreeMap<String, String>,
    /// Values that the detectors behind one twin share, because they process the same samples.
    pub shared: &'a tauscope_detect::Shared,
}

impl LiveSite<'_> {
    /// The cell of a stage that has one.
    ///
    /// # Errors
    /// If it has none.
    pub fn cell(&self) -> Result<&Cell, NodeError> {
        self.cells.first().ok_or(NodeError::NoCell)
    }
}

/// Surroundings of a stage in a replay.
pub struct ReplaySite<'a> {
    /// The cell of the recording.
    pub cell: &'a Cell,
    /// The recording.
    pub recording: &'a Path,
    /// Folder of the output files.
    pub out: Option<&'a Path>,
    /// Settings of the source that the recording replaces.
    pub source: &'a tauscope_ingest::Config,
    /// Whether the twin's effort is that of the recording.
    pub keeps_twin: bool,
    /// Whether the recording is read in a separate thread.
    pub reads_ahead: bool,
    /// The pipeline.
    pub pipeline: &'a Pipeline,
    /// Indices of the stages whose streams it receives.
    pub inputs: &'a [usize],
    /// Values that the detectors behind one twin share, because they process the same samples.
    pub shared: tauscope_detect::Shared,
    /// Findings of the source, which it sets.
    pub findings: &'a mut Findings,
    /// Output files, to which the stage adds its own.
    pub files: &'a mut Vec<PathBuf>,
}
