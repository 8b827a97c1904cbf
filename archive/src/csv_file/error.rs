//! Errors in CSV tables, with file and line.

use std::path::PathBuf;

/// Longest piece of a table that is shown in an error \[characters\].
/// Layout: by eye; no number depends on it.
const SHOWN_CHARS: usize = 40;

/// An error in a CSV table, with its file and line.
#[derive(Debug, thiserror::Error)]
#[error("{}:{line}: {problem}", path.display())]
pub struct CsvError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: u64,
    /// The problem in that line.
    pub problem: CsvProblem,
}

/// A problem in a line of a CSV table.
#[derive(Debug, thiserror::Error)]
pub enum CsvProblem {
    /// A number of columns that differs from that of the first line.
    #[error("{found} columns, the lines before have {expected}")]
    Width {
        /// Number of columns in this line.
        found: usize,
        /// Number of columns in the first line.
        expected: usize,
    },
    /// A cell that is not a number.
    #[error("column {column} ({what}): {text:?} is not a number")]
    NotANumber {
        /// The column, from 1.
        column: usize,
        /// Quantity and joint that the mapping assigns to the column.
        what: String,
        /// Text of the cell, shortened.
        text: String,
    },
    /// A time that is not a number or is outside the range of a ROS stamp.
    #[error(
        "column {column} (time): {text:?} is not a time from 0 to {:e} s",
        super::limits::TIME_S
    )]
    Time {
        /// The column, from 1.
        column: usize,
        /// Text of the cell, shortened.
        text: String,
    },
    /// A time that is not a date, in a table whose first time is a date.
    #[error(
        "column {column} (time): {text:?} is not a date and time such as 2026-11-28T20:20:24.123Z, from 1970 to 2038"
    )]
    Date {
        /// The column, from 1.
        column: usize,
        /// Text of the cell, shortened.
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
    /// Identical times in all rows.
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
    /// An unclosed quotation mark.
    #[error("{}: a cell begins with a quotation mark, and the second mark is missing", place(*column))]
    OpenQuote {
        /// The column, from 1; `None` if it is not known.
        column: Option<usize>,
    },
    /// A line longer than any table of joints.
    #[error("a line of more than {limit} bytes: this is not a table")]
    LineTooLong {
        /// Maximum length of a line \[bytes\].
        limit: usize,
    },
}

fn place(column: Option<usize>) -> String {
    column.map_or_else(
        || "this line".to_owned(),
        |column| format!("column {column}"),
    )
}

/// Shortens a piece of a table for an error message.
pub(super) fn shown(bytes: &[u8]) -> String {
    let text = String::from_utf8_lossy(bytes);
    let mut chars = text.chars();
    let mut shown: String = chars.by_ref().take(SHOWN_CHARS).collect();
    if chars.next().is_some() {
        shown.push('…');
    }
    shown
}
