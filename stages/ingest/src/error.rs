//! Why a source cannot be opened, or not be read on.

use tauscope_archive::ArchiveError;
use tauscope_session::{SessionError, Unusable};

use crate::config::ConfigError;
use crate::simulated::ScenarioError;

/// Why a source cannot be opened, or not be read on.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// The configuration makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The recording cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// The recording can be read, but holds no sample of this cell.
    #[error("{origin}: {source}")]
    Pack {
        /// Where the messages came from.
        origin: String,
        /// What is wrong with them.
        source: Unusable,
    },
    /// The recording gives no joint states of this cell.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The scenario cannot be simulated.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The system has no thread left.
    #[error("no thread for the source: {0}")]
    Thread(std::io::Error),
    /// Zenoh cannot be reached, or not be used.
    #[error("zenoh: {0}")]
    Zenoh(String),
}

impl IngestError {
    /// Whether the arguments or files are wrong (exit code 2), rather than what happened since
    /// (exit code 1).
    pub fn is_input(&self) -> bool {
        !matches!(
            self,
            Self::Zenoh(_)
                | Self::Thread(_)
                | Self::Scenario(
                    ScenarioError::Unstable { .. }
                        | ScenarioError::Write(_)
                        | ScenarioError::Labels { .. }
                )
        )
    }
}
