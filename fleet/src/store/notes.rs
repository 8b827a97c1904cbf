//! Maintenance notes on cells.

use rusqlite::params;
use serde::Serialize;

use super::{Store, StoreError};

/// A maintenance note on a cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Note {
    /// Time \[ns since the epoch\].
    pub at_ns: i64,
    /// The user.
    pub by: String,
    /// The text.
    pub text: String,
    /// Whether the normal residual of the cell is learned again from here on.
    pub baseline: bool,
}

/// Returns the times of the notes that begin a new baseline \[days since 1970-01-01 UTC\].
pub fn baselines(notes: &[Note]) -> Vec<f64> {
    let begins = notes.iter().filter(|note| note.baseline);
    begins.map(|note| note.at_ns as f64 / 86_400e9).collect()
}

impl Store {
    /// Stores a note.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn note(&self, cell: &str, note: &Note) -> Result<(), StoreError> {
        let text =
            "INSERT INTO notes (cell, at_ns, by, text, baseline) VALUES (?1, ?2, ?3, ?4, ?5)";
        let values = params![cell, note.at_ns, note.by, note.text, note.baseline];
        let done = self.connection.execute(text, values);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Returns the newest notes of a cell.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn notes(&self, cell: &str, most: u32) -> Result<Vec<Note>, StoreError> {
        let text = "SELECT at_ns, by, text, baseline FROM notes WHERE cell = ?1 ORDER BY at_ns DESC LIMIT ?2";
        self.rows(text, params![cell, most], |row| {
            Ok(Note {
                at_ns: row.get(0)?,
                by: row.get(1)?,
                text: row.get(2)?,
                baseline: row.get(3)?,
            })
        })
    }
}
