//! Records of a table: cells, line numbers, and the torn end.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader};
use std::path::{Path, PathBuf};

use super::error::{CsvError, CsvProblem};
use super::lines::{BUFFER_BYTES, Lines, MAX_LINE_BYTES};
use crate::error::ArchiveError;

/// Delimiters that are recognised, the least ambiguous first: a comma may also be a decimal comma.
const DELIMITERS: [u8; 3] = [b'\t', b';', b','];

pub(super) struct Records {
    path: PathBuf,
    reader: csv::Reader<BufReader<Lines<File>>>,
    delimiter: u8,
    skipped_lines: u64,
    fields: csv::ByteRecord,
    line: u64,
}

impl Records {
    /// Opens the table at `path` behind its first `skip_lines` lines. Without a `delimiter`, it is recognised.
    pub(super) fn open(
        path: &Path,
        delimiter: Option<u8>,
        skip_lines: usize,
    ) -> Result<Self, ArchiveError> {
        let io = |error| ArchiveError::io(path)(error);
        let file = File::open(path).map_err(io)?;
        let mut text = BufReader::with_capacity(BUFFER_BYTES, Lines::new(file));
        for _ in 0..skip_lines {
            if text.skip_until(b'\n').map_err(io)? == 0 {
                break;
            }
        }
        let delimiter = match delimiter {
            Some(delimiter) => delimiter,
            None => recognised_delimiter(text.fill_buf().map_err(io)?),
        };
        Ok(Self {
            path: path.to_owned(),
            reader: csv::ReaderBuilder::new()
                .has_headers(false)
                .flexible(true)
                .delimiter(delimiter)
                .from_reader(text),
            delimiter,
            skipped_lines: skip_lines as u64,
            fields: csv::ByteRecord::new(),
            line: 0,
        })
    }

    /// Reads the next record that is not blank; `false` at the end.
    pub(super) fn read(&mut self) -> Result<bool, ArchiveError> {
        loop {
            self.reader.get_mut().get_mut().start_record();
            let read = self.reader.read_byte_record(&mut self.fields);
            if !read.map_err(|error| self.broken(error))? {
                return Ok(false);
            }
            // The reader counts the line ends that it has passed, and starts behind the record before.
            let within = self.fields.as_slice().iter().filter(|&&b| b == b'\n');
            let passed = within.count() as u64 + u64::from(!self.is_last_unended());
            self.line = self.skipped_lines + self.reader.position().line().saturating_sub(passed);
            let is_blank = |field: &[u8]| field.trim_ascii().is_empty();
            if self.width() > 1 || !self.fields.iter().all(is_blank) {
                return Ok(true);
            }
        }
    }

    pub(super) fn width(&self) -> usize {
        self.fields.len()
    }

    /// The cell in a column of the record that was read last, without blanks around it.
    pub(super) fn cell(&self, column: usize) -> &[u8] {
        unquoted(self.fields[column].trim_ascii())
    }

    /// All cells of the record that was read last, as text.
    pub(super) fn cells(&self) -> Vec<String> {
        let cells = (0..self.width()).map(|column| self.cell(column));
        cells
            .map(|cell| String::from_utf8_lossy(cell).into_owned())
            .collect()
    }

    /// The line on which the record that was read last starts, from 1.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    pub(super) fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// Whether the file ends within the record that was read last.
    pub(super) fn is_last_unended(&self) -> bool {
        self.reader.get_ref().get_ref().at_end()
    }

    /// The first column of the record with a cell of several lines, from 1.
    pub(super) fn column_of_several_lines(&self) -> Option<usize> {
        let mut columns = self.fields.iter();
        let column = columns.position(|field| field.contains(&b'\n'))?;
        Some(column + 1)
    }

    /// An error in the record that was read last.
    pub(super) fn refuse(&self, problem: CsvProblem) -> ArchiveError {
        self.refuse_line(self.line, problem)
    }

    fn refuse_line(&self, line: u64, problem: CsvProblem) -> ArchiveError {
        ArchiveError::Csv(Box::new(CsvError {
            path: self.path.clone(),
            line,
            problem,
        }))
    }

    fn broken(&self, error: csv::Error) -> ArchiveError {
        match error.into_kind() {
            csv::ErrorKind::Io(error) if error.kind() == io::ErrorKind::InvalidData => {
                let start = self.fields.position().map_or(0, csv::Position::line);
                let is_one_line = self.reader.position().line() == start;
                let limit = MAX_LINE_BYTES;
                let problem = if is_one_line {
                    CsvProblem::LineTooLong { limit }
                } else {
                    CsvProblem::OpenQuote { column: None }
                };
                self.refuse_line(self.skipped_lines + start, problem)
            }
            csv::ErrorKind::Io(error) => ArchiveError::io(&self.path)(error),
            // Records of bytes, of any length: nothing else can be wrong with them.
            other => ArchiveError::io(&self.path)(io::Error::other(format!("{other:?}"))),
        }
    }
}

/// A cell whose quotation marks the reader left, because blanks precede them.
fn unquoted(cell: &[u8]) -> &[u8] {
    cell.strip_prefix(b"\"")
        .and_then(|cell| cell.strip_suffix(b"\""))
        .unwrap_or(cell)
}

/// The delimiter of a table that begins with `head`.
///
/// It occurs equally often in the first and the second record. A table without any other delimiter is separated by
/// spaces.
fn recognised_delimiter(head: &[u8]) -> u8 {
    let mut is_quoted = false;
    let records = head.split(|&byte| {
        is_quoted ^= byte == b'"';
        byte == b'\n' && !is_quoted
    });
    let mut records = records.filter(|record| !record.trim_ascii().is_empty());
    let (first, second) = (records.next().unwrap_or_default(), records.next());
    let count = |record: &[u8], delimiter: u8| {
        let mut is_quoted = false;
        let is_one = |byte: &u8| {
            is_quoted ^= *byte == b'"';
            *byte == delimiter && !is_quoted
        };
        record.iter().copied().filter(is_one).count()
    };
    let stand = DELIMITERS.map(|delimiter| (delimiter, count(first, delimiter)));
    let mut stand = stand.into_iter().filter(|&(_, times)| times > 0);
    let fallback = stand.clone().next();
    let steady = stand
        .find(|&(delimiter, times)| second.is_none_or(|second| count(second, delimiter) == times));
    match steady.or(fallback) {
        Some((delimiter, _)) => delimiter,
        None if first.trim_ascii().contains(&b' ') => b' ',
        None => b',',
    }
}
