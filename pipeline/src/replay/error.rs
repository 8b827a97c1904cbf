//! Why a replay cannot be, or was not brought to its end.

use crate::build;

/// Why a replay cannot be, or was not brought to its end.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The pipeline has no source whose place a recording could take.
    #[error("the pipeline has no `ingest` stage in whose place the recording could be read")]
    NoSource,
    /// It has several.
    #[error("the pipeline reads {}: choose one with --source", stages.join(", "))]
    ManySources {
        /// They.
        stages: Vec<String>,
    },
    /// There is no such source.
    #[error("the pipeline has no source named `{name}`; there is {known}")]
    UnknownSource {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// The recording cannot be read.
    #[error(transparent)]
    Ingest(#[from] tauscope_ingest::IngestError),
    /// A stage cannot be built.
    #[error(transparent)]
    Build(#[from] build::BuildError),
    /// What is written cannot be.
    #[error(transparent)]
    Record(#[from] tauscope_record::RecordError),
    /// A stage failed on the way.
    #[error(transparent)]
    Stage(#[from] tauscope_bus::StageError),
    /// A link failed.
    #[error(transparent)]
    Link(#[from] tauscope_bus::LinkError),
    /// Whoever asked for it does not want it any more.
    #[error("interrupted")]
    Interrupted,
}

impl ReplayError {
    /// Whether the arguments or files are wrong (exit code 2), rather than what happened since.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Ingest(error) => error.is_input(),
            Self::Record(_) | Self::Stage(_) | Self::Link(_) | Self::Interrupted => false,
            _ => true,
        }
    }
}
