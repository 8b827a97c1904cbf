//! Errors of repairing a recording.

use std::path::PathBuf;

use crate::error::ArchiveError;
use crate::mcap_write::WriteError;

/// An error of repairing a recording.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// A recording that cannot be read at all.
    #[error(transparent)]
    Read(#[from] ArchiveError),
    /// A new file that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// An output path that already exists.
    #[error("{} is there already; give another name with --out", path.display())]
    Exists {
        /// The output path.
        path: PathBuf,
    },
    /// A file that is still being written.
    #[error("{}: a process is still writing it: repair it when that has ended", path.display())]
    BeingWritten {
        /// The file.
        path: PathBuf,
    },
    /// A folder without MCAP files.
    #[error("{}: a folder without MCAP files (.mcap, .mcap.part)", path.display())]
    NothingThere {
        /// The folder.
        path: PathBuf,
    },
}
