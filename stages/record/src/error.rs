//! What can go wrong in a recorder.

use std::path::PathBuf;

use tauscope_bus::SampleKind;

use crate::file_name::FileNameError;

/// Why a recorder cannot be made, or cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The configuration asks for nothing.
    #[error(
        "a recorder must write something: give `mcap`, `rerun: {{file: …}}`, `rerun: {{connect: …}}` or `around_alarms: {{mcap: …}}`"
    )]
    NothingToWrite,
    /// A file's name cannot be filled in.
    #[error(transparent)]
    FileName(#[from] FileNameError),
    /// There are to be several files, and all would have one name.
    #[error(
        "there are to be several files, but `{name}` names only one: put `{{n}}` or `{{time}}` into it", name = name.display()
    )]
    OneName {
        /// The name.
        name: PathBuf,
    },
    /// The file of one cell is asked for where several are recorded.
    #[error("`{{cell}}` in a file's name stands for one cell, but the recorder listens to {cells}")]
    SeveralCells {
        /// How many.
        cells: usize,
    },
    /// A folder cannot be looked into.
    #[error("cannot look for a new file name: {0}")]
    Folder(std::io::Error),
    /// Two cells of one name.
    #[error("two cells are named `{cell}`")]
    DuplicateCell {
        /// The name.
        cell: String,
    },
    /// Two streams of one stage.
    #[error("two streams come from a stage named `{stage}`")]
    DuplicateStream {
        /// The stage.
        stage: String,
    },
    /// A stream of a cell that is not there.
    #[error("stage `{stage}` belongs to cell `{cell}`, but the recorder knows only: {known}")]
    UnknownCell {
        /// The stage.
        stage: String,
        /// Its cell.
        cell: String,
        /// The cells there are.
        known: String,
    },
    /// A sample of a stage that was not announced.
    #[error("a sample came from stage `{stage}`, but the recorder listens only to: {known}")]
    UnknownStream {
        /// The stage.
        stage: String,
        /// The stages there are.
        known: String,
    },
    /// A sample of another type than was announced.
    #[error("stage `{stage}` sent a {found}, expected a {expected}", found = found.type_name(), expected = expected.type_name())]
    WrongKind {
        /// The stage.
        stage: String,
        /// What was announced.
        expected: SampleKind,
        /// What came.
        found: SampleKind,
    },
    /// A sample of another number of joints than its cell has.
    #[error("stage `{stage}` sent {found} joints, its cell `{cell}` has {expected}")]
    JointCount {
        /// The stage.
        stage: String,
        /// Its cell.
        cell: String,
        /// How many joints the cell has.
        expected: usize,
        /// How many came.
        found: usize,
    },
    /// A model with other joints than the cell.
    #[error("cell `{cell}` has {joints} joints, its robot model {model}")]
    ModelJoints {
        /// The cell.
        cell: String,
        /// How many joints the cell has.
        joints: usize,
        /// How many the model has.
        model: usize,
    },
    /// The archive cannot be written.
    #[error(transparent)]
    Archive(#[from] tauscope_archive::WriteError),
    /// The picture's file cannot be written.
    #[error("cannot write `{path}`: {reason}", path = path.display())]
    RerunFile {
        /// The file.
        path: PathBuf,
        /// What failed.
        reason: String,
        /// The disk is full.
        full: bool,
    },
    /// The viewer's address is not one.
    #[error(
        "`{url}` is no address of a Rerun viewer such as rerun+http://127.0.0.1:9876/proxy: {reason}"
    )]
    Connect {
        /// What was given.
        url: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Rerun could not take the data.
    #[error("cannot encode `{entity}` for Rerun: {reason}")]
    Encode {
        /// The entity.
        entity: String,
        /// What failed.
        reason: String,
    },
}

impl RecordError {
    /// Whether nothing is wrong but that the disk, or this user's share of it, is full.
    pub(crate) fn is_disk_full(&self) -> bool {
        match self {
            Self::Archive(error) => says_full(error),
            Self::RerunFile { full, .. } => *full,
            _ => false,
        }
    }
}

/// Whether `error`, or what lies behind it, is that the disk is full.
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
