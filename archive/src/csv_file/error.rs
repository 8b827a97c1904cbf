//! What is wrong in a table, and where.

use std::path::PathBuf;

/// Longest piece of a table that is shown in an error \[characters\].
/// Tuned: by eye, for the length of the message.
const SHOWN_CHARS: usize = 40;

/// What is wrong in a table, and where.
#[derive(Debug, thiserror::Error)]
#[error("{}:{line}: {problem}", path.display())]
pub struct CsvError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: u64,
    /// What is wrong.
    pub problem: CsvProblem,
}

/// What is wrong in a line of a table.
#[derive(Debug, thiserror::Error)]
pub enum CsvProblem {
    /// Not as many columns as the first line has.
    #[error("{found} columns, the lines before have {expected}")]
    Width {
        /// Columns here.
        found: usize,
        /// Columns there.
        expected: usize,
    },
    /// Not a number.
    #[error("column {column} ({what}): {text:?} is not a number")]
    NotANumber {
        /// The column, from 1.
        column: usize,
        /// What the mapping takes it for.
        what: String,
        /// What stands there, shortened.
        text: String,
    },
    /// No time from zero to what a stamp can hold.
    #[error(
        "column {column} (time): {text:?} is not a time from 0 to {:e} s",
        super::limits::TIME_S
    )]
    Time {
        /// The column, from 1.
        column: usize,
        /// What stands there, shortened.
        text: String,
    },
    /// No date, in a table whose first time is a date.
    #[error(
        "column {column} (time): {text:?} is not a date and time such as 2026-11-28T20:20:24.123Z, from 1970 to 2038"
    )]
    Date {
        /// The column, from 1.
        column: usize,
        /// What stands there, shortened.
        text: String,
    },
    /// A time before the one in the line above.
    #[error("column {column} (time): {time_s} s comes after {before_s} s: time runs backwards")]
    Backwards {
        /// The column, from 1.
        column: usize,
        /// The time here \[s\].
        time_s: f64,
        /// The time above \[s\].
        before_s: f64,
    },
    /// All rows have one time.
    #[error(
        "column {column} (time): all {rows} rows have the time {time_s} s: the clock stands still"
    )]
    ClockStandsStill {
        /// The column, from 1.
        column: usize,
        /// Number of rows.
        rows: u64,
        /// Their time \[s\].
        time_s: f64,
    },
    /// A quotation mark without its second one.
    #[error("{}: a cell begins with a quotation mark, and the second mark is missing", place(*column))]
    OpenQuote {
        /// The column, from 1; `None` if it is not known.
        column: Option<usize>,
    },
    /// A line longer than any table of joints.
    #[error("a line of more than {limit} bytes: this is not a table")]
    LineTooLong {
        /// What it may be at most \[bytes\].
        limit: usize,
    },
}

fn place(column: Option<usize>) -> String {
    column.map_or_else(
        || "this line".to_owned(),
        |column| format!("column {column}"),
    )
}

/// A piece of a table as an error shows it.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut chars = text.chars();
    let mut shown: String = chars.by_ref().take(SHOWN_CHARS).collect();
    if chars.next().is_some() {
        shown.push('…');
    }
    shown
}
