//! Why a recording cannot be repaired.

use std::path::PathBuf;

use crate::error::ArchiveError;
use crate::mcap_write::WriteError;

/// Why a recording cannot be repaired.
#[derive(Debug, thiserror::Error)]
pub enum RepairError {
    /// It cannot be read at all.
    #[error(transparent)]
    Read(#[from] ArchiveError),
    /// The new file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Something lies where the new file should go.
    #[error("{} is there already; give another name with --out", path.display())]
    Exists {
        /// Where.
        path: PathBuf,
    },
    /// It grows while it is read.
    #[error("{}: a process is still writing it: repair it when that has ended", path.display())]
    BeingWritten {
        /// Which.
        path: PathBuf,
    },
    /// A folder without any.
    #[error("{}: a folder without MCAP files (.mcap, .mcap.part)", path.display())]
    NothingThere {
        /// Which.
        path: PathBuf,
    },
}
