//! Errors of reading Parquet files.

use std::path::{Path, PathBuf};

/// Error of reading a Parquet file, with its path.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct ParquetError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
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

/// A problem of a Parquet file.
#[derive(Debug, thiserror::Error)]
pub enum ParquetProblem {
    /// An I/O error.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// A file that does not begin with the magic of Parquet.
    #[error("not a Parquet table: it does not begin with PAR1")]
    NotParquet,
    /// A Git LFS pointer whose content was not fetched.
    #[error(
        "a Git LFS pointer instead of the Parquet table: fetch the table with `git lfs pull`, or download the data \
         set with `hf download`"
    )]
    LfsPointer,
    /// A truncated file, which does not end with the magic of Parquet.
    #[error(
        "the Parquet table is truncated: it does not end with a footer and PAR1; copy or download it again"
    )]
    Torn,
    /// A malformed footer.
    #[error("the footer of the Parquet table is malformed: {0}")]
    Footer(&'static str),
    /// A declared size above the memory limit.
    #[error("{what} of the Parquet table is {bytes} bytes; at most {limit} are held in memory")]
    TooLarge {
        /// Name of the part of the file.
        what: &'static str,
        /// Declared size \[bytes\].
        bytes: u64,
        /// Limit \[bytes\].
        limit: u64,
    },
    /// A column that the table does not have.
    #[error("the Parquet table has no column {column:?}; it has {known}")]
    NoColumn {
        /// The requested column.
        column: String,
        /// The columns of the table.
        known: String,
    },
    /// A column that is not numeric, or is stored in an unsupported way.
    #[error(
        "column {column:?} is {what}, which is not supported: write the table again with pyarrow, \
         `pq.write_table(pq.read_table(FILE), FILE)`"
    )]
    Unsupported {
        /// The column.
        column: String,
        /// Description of the type or storage.
        what: String,
    },
    /// A malformed page of a column.
    #[error("column {column:?} is damaged from row {row} on: {reason}")]
    Page {
        /// The column.
        column: String,
        /// The first row that cannot be read, from 0.
        row: u64,
        /// Reason.
        reason: &'static str,
    },
}
