//! Reader of numeric columns of a Parquet file (<https://parquet.apache.org/docs/file-format/>), row by row.
//!
//! Supported are numbers and lists of numbers, plain or by dictionary, in pages of version 1 and 2, uncompressed or
//! compressed with Snappy or Zstandard. pyarrow, pandas, Hugging Face `datasets` and Polars write this by default.
//! Any other type, encoding or compression is rejected with an error that names it.
//!
//! Files are not trusted. A declared size is checked against the file and a limit before memory is allocated. Only
//! one page per column and its dictionary are in memory.

mod error;
mod footer;
mod hybrid;
mod page;
mod rows;
mod thrift;

use std::fs::File;
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use error::{ParquetError, ParquetProblem};
use footer::Footer;
pub(crate) use footer::Physical;
pub(crate) use rows::Rows;

/// First and last bytes of a Parquet file.
pub(crate) const MAGIC: &[u8] = b"PAR1";
/// First bytes of a file that Git LFS has not fetched: `version https://git-lfs.github.com/spec/v1`.
const LFS_POINTER: [u8; 4] = *b"vers";
/// Maximum size of the footer \[bytes\].
/// Resolution: bounds memory; a thousand row groups of 300 columns have 45 MB.
const MAX_FOOTER_BYTES: u64 = 64 << 20;
/// Size of the footer's length and the magic at the end of the file \[bytes\].
const TAIL_BYTES: u64 = 8;

/// An open file with the selected columns.
#[derive(Debug)]
pub(crate) struct ParquetFile {
    path: PathBuf,
    file: File,
    pub(crate) bytes: u64,
    footer: Footer,
}

impl ParquetFile {
    /// Opens the file at `path` to read the columns `wanted`. [`ParquetFile::has`] returns whether one exists.
    ///
    /// # Errors
    /// If it is truncated, or its footer is malformed or too long.
    pub(crate) fn open(path: &Path, wanted: &[&str]) -> Result<Arc<Self>, ParquetError> {
        let refuse = |problem: ParquetProblem| ParquetError::new(path, problem);
        let file = File::open(path).map_err(|error| refuse(error.into()))?;
        let metadata = file.metadata().map_err(|error| refuse(error.into()))?;
        let bytes = metadata.len();
        let text = footer_of(&file, bytes).map_err(refuse)?;
        let footer = Footer::parse(&text, wanted, bytes).map_err(refuse)?;
        Ok(Arc::new(Self {
            path: path.to_owned(),
            file,
            bytes,
            footer,
        }))
    }

    /// Returns its path.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the number of rows.
    pub(crate) fn rows(&self) -> u64 {
        self.footer.groups.iter().map(|group| group.rows).sum()
    }

    /// Returns the storage type of a selected column, if the file has it.
    pub(crate) fn physical(&self, column: &str) -> Option<Physical> {
        let leaf = self.footer.leaves.iter().find(|leaf| leaf.name == column)?;
        Some(leaf.physical)
    }

    /// Returns whether the file has a selected column.
    pub(crate) fn has(&self, column: &str) -> bool {
        self.physical(column).is_some()
    }

    /// Returns the rows of `column`, starting at row `first`.
    ///
    /// # Errors
    /// If there is no such column, it is not numeric, or the rows before `first` cannot be read.
    pub(crate) fn column(self: &Arc<Self>, column: &str, first: u64) -> Result<Rows, ParquetError> {
        let place = (self.footer.leaves.iter()).position(|leaf| leaf.name == column);
        let Some(place) = place else {
            let known = self.footer.names.join(", ");
            let problem = ParquetProblem::NoColumn {
                column: column.to_owned(),
                known,
            };
            return Err(ParquetError::new(&self.path, problem));
        };
        Rows::open(Arc::clone(self), place, first)
    }

    /// Fills `buffer` with the bytes at offset `at`.
    fn read(&self, buffer: &mut [u8], at: u64) -> Result<(), ParquetProblem> {
        Ok(self.file.read_exact_at(buffer, at)?)
    }
}

/// The bytes of the footer.
fn footer_of(file: &File, bytes: u64) -> Result<Vec<u8>, ParquetProblem> {
    let magic = MAGIC.len() as u64;
    let mut head = [0; MAGIC.len()];
    if bytes < magic + TAIL_BYTES {
        return Err(ParquetProblem::Torn);
    }
    file.read_exact_at(&mut head, 0)?;
    if head == LFS_POINTER {
        return Err(ParquetProblem::LfsPointer);
    }
    if head != MAGIC {
        return Err(ParquetProblem::NotParquet);
    }
    let mut tail = [0; TAIL_BYTES as usize];
    file.read_exact_at(&mut tail, bytes - TAIL_BYTES)?;
    let [a, b, c, d, end @ ..] = tail;
    if end != MAGIC {
        return Err(ParquetProblem::Torn);
    }
    let length = u64::from(u32::from_le_bytes([a, b, c, d]));
    if length > MAX_FOOTER_BYTES {
        return Err(ParquetProblem::TooLarge {
            what: "the footer",
            bytes: length,
            limit: MAX_FOOTER_BYTES,
        });
    }
    let start = (bytes - TAIL_BYTES).checked_sub(length);
    let start = start.filter(|start| *start >= magic);
    let start = start.ok_or(ParquetProblem::Footer("it is longer than the file"))?;
    let mut text = vec![0; length as usize];
    file.read_exact_at(&mut text, start)?;
    Ok(text)
}
