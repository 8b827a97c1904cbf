//! Errors of a recorder.

use std::path::PathBuf;

use tauscope_bus::SampleKind;

use crate::file_name::FileNameError;

/// Error that prevents or ends recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// A configuration without output.
    #[error(
        "a recorder must write something: give `mcap`, `rerun: {{file: …}}`, `rerun: {{connect: …}}` or `around_alarms: {{mcap: …}}`"
    )]
    NothingToWrite,
    /// An invalid file name.
    #[error(transparent)]
    FileName(#[from] FileNameError),
    /// A single name for several files.
    #[error(
        "there are to be several files, but `{name}` names only one: put `{{n}}` or `{{time}}` into it", name = name.display()
    )]
    OneName {
        /// The name.
        name: PathBuf,
    },
    /// A file name with `{cell}` for a recorder of several cells.
    #[error("`{{cell}}` in a file's name stands for one cell, but the recorder listens to {cells}")]
    SeveralCells {
        /// Number of cells.
        cells: usize,
    },
    /// A folder that cannot be listed.
    #[error("cannot look for a new file name: {0}")]
    Folder(std::io::Error),
    /// Two cells with the same name.
    #[error("two cells are named `{cell}`")]
    DuplicateCell {
        /// The name.
        cell: String,
    },
    /// Two streams from the same stage.
    #[error("two streams come from a stage named `{stage}`")]
    DuplicateStream {
        /// The stage.
        stage: String,
    },
    /// A stream of an unknown cell.
    #[error("stage `{stage}` belongs to cell `{cell}`, but the recorder knows only: {known}")]
    UnknownCell {
        /// The stage.
        stage: String,
        /// Its cell.
        cell: String,
        /// The known cells.
        known: String,
    },
    /// A sample of an unannounced stage.
    #[error("a sample came from stage `{stage}`, but the recorder listens only to: {known}")]
    UnknownStream {
        /// The stage.
        stage: String,
        /// The announced stages.
        known: String,
    },
    /// A sample of an unexpected type.
    #[error("stage `{stage}` sent a {found}, expected a {expected}", found = found.type_name(), expected = expected.type_name())]
    WrongKind {
        /// The stage.
        stage: String,
        /// The announced type.
        expected: SampleKind,
        /// The received type.
        found: SampleKind,
    },
    /// A sample with the wrong number of joints.
    #[error("stage `{stage}` sent {found} joints, its cell `{cell}` has {expected}")]
    JointCount {
        /// The stage.
        stage: String,
        /// Its cell.
        cell: String,
        /// Number of joints of the cell.
        expected: usize,
        /// Number of joints of the sample.
        found: usize,
    },
    /// A model whose number of joints differs from that of the cell.
    #[error("cell `{cell}` has {joints} joints, its robot model {model}")]
    ModelJoints {
        /// The cell.
        cell: String,
        /// Number of joints of the cell.
        joints: usize,
        /// Number of joints of the model.
        model: usize,
    },
    /// A failed write of the archive.
    #[error(transparent)]
    Archive(#[from] tauscope_archive::WriteError),
    /// A failed write of the picture's file.
    #[error("cannot write `{path}`: {reason}", path = path.display())]
    RerunFile {
        /// The file.
        path: PathBuf,
        /// The cause.
        reason: String,
        /// Whether the disk is full.
        full: bool,
    },
    /// An invalid address of a viewer.
    #[error(
        "`{url}` is no address of a Rerun viewer such as rerun+http://127.0.0.1:9876/proxy: {reason}"
    )]
    Connect {
        /// The given address.
        url: String,
        /// The cause.
        reason: String,
    },
    /// Data that Rerun cannot encode.
    #[error("cannot encode `{entity}` for Rerun: {reason}")]
    Encode {
        /// The entity.
        entity: String,
        /// The cause.
        reason: String,
    },
}

impl RecordError {
    /// Whether the cause is a full disk or an exceeded quota.
    pub(crate) fn is_disk_full(&self) -> bool {
        match self {
            Self::Archive(error) => says_full(error),
            Self::RerunFile { full, .. } => *full,
            _ => false,
        }
    }
}

/// Whether `error` or one of its sources is a full disk or an exceeded quota.
pub(crate) fn says_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let full = |error: &std::io::Error| {
        matches!(
            error.kind(),
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded
        )
    };
    std::iter::successors(Some(error), |error| error.source())
        .filter_map(|error| error.downcast_ref())
        .any(full)
}
