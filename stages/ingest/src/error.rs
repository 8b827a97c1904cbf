//! Errors of opening and reading a source.

use tauscope_archive::ArchiveError;
use tauscope_session::{SessionError, Unusable};

use crate::config::ConfigError;
use crate::simulated::ScenarioError;

/// Errors of opening and reading a source.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// An invalid configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A recording that cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// A readable recording without a sample of this cell.
    #[error("{origin}: {source}")]
    Pack {
        /// Origin of the messages.
        origin: String,
        /// Reason why they cannot be used.
        source: Unusable,
    },
    /// A recording without joint states of this cell.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A scenario that cannot be simulated.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A thread that the system cannot start.
    #[error("no thread for the source: {0}")]
    Thread(std::io::Error),
    /// An error of Zenoh.
    #[error("zenoh: {0}")]
    Zenoh(String),
}

impl IngestError {
    /// Returns whether the arguments or files are at fault (exit code 2) rather than a later event
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
