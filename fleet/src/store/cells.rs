//! The cells that were ever seen.

use rusqlite::params;

use super::{Store, StoreError};
use crate::wall::Remembered;

/// Table of ended runs. It was added later: older files lack it, and older programs ignore it.
pub(super) const TABLE: &str = "
    CREATE TABLE IF NOT EXISTS ended (cell TEXT PRIMARY KEY, at_ns INTEGER NOT NULL) WITHOUT ROWID;
";

impl Store {
    /// Stores that a cell was seen.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn seen(&self, cell: &str, at_ns: i64, host: &str, robot: &str) -> Result<(), StoreError> {
        let text = "INSERT INTO cells VALUES (?1, ?2, ?3, ?4) ON CONFLICT (cell) DO UPDATE
                    SET seen_ns = ?2, host = ?3, robot = ?4";
        let done = self
            .connection
            .execute(text, params![cell, at_ns, host, robot]);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Stores the time of the normal end of a cell's run; `None` if it has not ended.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn ended(&self, cell: &str, at_ns: Option<i64>) -> Result<(), StoreError> {
        let done = if let Some(at_ns) = at_ns {
            let text = "INSERT OR REPLACE INTO ended VALUES (?1, ?2)";
            self.connection.execute(text, params![cell, at_ns])
        } else {
            let text = "DELETE FROM ended WHERE cell = ?1";
            self.connection.execute(text, [cell])
        };
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Returns the cells that were ever seen.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn cells(&self) -> Result<Vec<Remembered>, StoreError> {
        let text = "SELECT cell, seen_ns, ended.at_ns FROM cells LEFT JOIN ended USING (cell) ORDER BY cell";
        self.rows(text, [], |row| {
            Ok(Remembered {
                cell: row.get(0)?,
                seen_ns: row.get(1)?,
                ended_ns: row.get(2)?,
            })
        })
    }
}
