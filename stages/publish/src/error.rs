//! Errors of publishing.

use std::net::SocketAddr;

use tauscope_bus::LinkError;

use crate::config::ConfigError;

/// Errors of publishing.
#[derive(Debug, thiserror::Error)]
pub enum PublishError {
    /// An invalid configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A Zenoh session that cannot listen or connect.
    #[error(transparent)]
    Session(#[from] LinkError),
    /// A key, token or message that Zenoh rejects.
    #[error("zenoh: {0}")]
    Zenoh(String),
    /// A ROS 2 message that cannot be encoded.
    #[error(transparent)]
    Cdr(#[from] tauscope_archive::ros::EncodeError),
    /// A JSON message that cannot be encoded.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A Modbus server that cannot listen.
    #[error("cannot serve Modbus at {address}: {source}; is the port taken, or below 1024?")]
    Modbus {
        /// Address to listen on.
        address: SocketAddr,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A sample of a stage that is not an input of the publisher.
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
