//! Errors of a replay.

use crate::build;
use crate::pipeline::NodeError;

/// Error that prevents or ends a replay.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A pipeline without a source that a recording could replace.
    #[error("the pipeline has no `ingest` stage in whose place the recording could be read")]
    NoSource,
    /// A pipeline with several sources.
    #[error("the pipeline reads {}: choose one with --source", stages.join(", "))]
    ManySources {
        /// The sources.
        stages: Vec<String>,
    },
    /// A source that the pipeline does not have.
    #[error("the pipeline has no source named `{name}`; there is {known}")]
    UnknownSource {
        /// The requested name.
        name: String,
        /// The existing sources.
        known: String,
    },
    /// An unreadable recording.
    #[error(transparent)]
    Ingest(#[from] tauscope_ingest::IngestError),
    /// A stage that cannot be built.
    #[error(transparent)]
    Build(#[from] build::BuildError),
    /// A stage whose node cannot be created.
    #[error(transparent)]
    Node(#[from] NodeError),
    /// A stage that failed during the replay.
    #[error(transparent)]
    Stage(#[from] tauscope_bus::StageError),
    /// A failed link.
    #[error(transparent)]
    Link(#[from] tauscope_bus::LinkError),
    /// Cancellation by the caller.
    #[error("interrupted")]
    Interrupted,
}

impl ReplayError {
    /// Whether the error is in the arguments or input files (exit code 2).
    pub fn is_input(&self) -> bool {
        match self {
            Self::Ingest(error) => error.is_input(),
            Self::Node(error) => error.is_input(),
            Self::Stage(_) | Self::Link(_) | Self::Interrupted => false,
            _ => true,
        }
    }
}
