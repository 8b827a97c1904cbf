//! Why a Parquet file cannot be read.

use std::path::{Path, PathBuf};

/// Why a Parquet file cannot be read, and which.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ParquetError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong.
    pub problem: ParquetProblem,
}

impl ParquetError {
    pub(super) fn new(path: &Path, problem: ParquetProblem) -> Self {
        Self {
            path: path.to_owned(),
            problem,
        }
    }
}

/// What is wrong with a Parquet file.
#[derive(Debug, thiserror::Error)]
pub enum ParquetProblem {
    /// The operating system refuses.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// It begins otherwise.
    #[error("not a Parquet table: it does not begin with PAR1")]
    NotParquet,
    /// It was cloned without its contents.
    #[error(
        "a pointer of Git LFS in the place of the Parquet table: fetch the table with `git lfs pull`, or download the data \
         set with `hf download`"
    )]
    LfsPointer,
    /// It ends otherwise.
    #[error(
        "the Parquet table is torn: it does not end with PAR1, where it says what is in it; copy or download it again"
    )]
    Torn,
    /// Its footer makes no sense.
    #[error("the footer of the Parquet table is broken: {0}")]
    Footer(&'static str),
    /// More memory would be needed than is allowed.
    #[error("{what} of the Parquet table is {bytes} bytes; at most {limit} are held in memory")]
    TooLarge {
        /// What is so large.
        what: &'static str,
        /// What it declares.
        bytes: u64,
        /// What is allowed.
        limit: u64,
    },
    /// The column is not there.
    #[error("the Parquet table has no column {column:?}; it has {known}")]
    NoColumn {
        /// What was asked for.
        column: String,
        /// Those that there are.
        known: String,
    },
    /// A column holds no numbers, or holds them in a way that is not read.
    #[error(
        "column {column:?} is {what}, which is not read: write the table again with pyarrow, \
         `pq.write_table(pq.read_table(FILE), FILE)`"
    )]
    Unsupported {
        /// The column.
        column: String,
        /// What it is.
        what: String,
    },
    /// A page of a column makes no sense.
    #[error("column {column:?} is damaged from row {row} on: {reason}")]
    Page {
        /// The column.
        column: String,
        /// The first row that cannot be read, from 0.
        row: u64,
        /// Why.
        reason: &'static str,
    },
}
