//! Why a recording cannot be written.

use std::path::{Path, PathBuf};

use crate::ros;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: std::io::Error,
    },
    /// The file cannot be written on.
    #[error("{}: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<mcap::McapError>,
    },
    /// A message cannot be encoded.
    #[error("{}: topic {topic:?}: {source}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// What is wrong with the message.
        source: ros::EncodeError,
    },
    /// The bag's metadata cannot be written as YAML.
    #[error("{}: {source}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: Box<serde_saphyr::SerializeError>,
    },
    /// MCAP knows no time before the epoch.
    #[error("{}: topic {topic:?}: a message at {ns} ns, before the epoch", path.display())]
    BeforeEpoch {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The time \[ns\].
        ns: i64,
    },
}

pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError::Io { path, source }
}

pub(crate) fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError::Mcap {
        path,
        source: Box::new(source),
    }
}

pub(crate) fn yaml(path: &Path) -> impl FnOnce(serde_saphyr::SerializeError) -> WriteError {
    let path = path.to_owned();
    move |source| WriteError::Metadata {
        path,
        source: Box::new(source),
    }
}
