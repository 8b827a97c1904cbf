//! Why nothing can be published.

use std::net::SocketAddr;

use tauscope_bus::LinkError;

use crate::config::ConfigError;

/// Why nothing can be published.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// The configuration makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Zenoh cannot listen or connect.
    #[error(transparent)]
    Session(#[from] LinkError),
    /// Zenoh does not take a key, a token or a message.
    #[error("zenoh: {0}")]
    Zenoh(String),
    /// A ROS 2 message cannot be written.
    #[error(transparent)]
    Cdr(#[from] tauscope_archive::ros::EncodeError),
    /// A JSON message cannot be written.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Nobody can be served.
    #[error("cannot serve Modbus at {address}: {source}; is the port taken, or below 1024?")]
    Modbus {
        /// Where it was to listen.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A sample came that nobody announced.
    #[error("a sample came from stage `{stage}`, which the publisher does not listen to")]
    UnknownStage {
        /// The stage.
        stage: String,
    },
}

impl PublishError {
    #[expect(
        clippy::needless_pass_by_value,
        reason = "so that it maps an error as it is"
    )]
    pub(crate) fn zenoh(error: zenoh::Error) -> Self {
        Self::Zenoh(error.to_string())
    }
}
