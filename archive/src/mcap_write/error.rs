//! Errors of writing a recording.

use std::path::{Path, PathBuf};

use crate::ros;

/// An error of writing a recording.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// An I/O error.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// An error of the MCAP writer.
    #[error("{}: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// The MCAP error.
        source: Box<mcap::McapError>,
    },
    /// A message that cannot be encoded.
    #[error("{}: topic {topic:?}: {source}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The encoding error.
        source: ros::EncodeError,
    },
    /// Bag metadata that cannot be written as YAML.
    #[error("{}: {source}", path.display())]
    Metadata {
        /// The file.
        path: PathBuf,
        /// The serialization error.
        source: Box<serde_saphyr::SerializeError>,
    },
    /// A time before the epoch, which MCAP cannot represent.
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
