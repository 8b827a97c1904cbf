//! SQLite store of a fleet host: contacts, incidents, the residual over weeks, notes.
//!
//! All times are in ns since the epoch. Data older than [`KEPT_NS`] are removed once an hour.

mod cells;
mod clock;
mod contacts;
mod history;
mod incidents;
mod labels;
mod notes;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};
use std::time::Duration;

use rusqlite::{Connection, Transaction, TransactionBehavior};

pub use clock::Aging;
pub use contacts::{KeptContact, Said};
pub use history::{Day, JointNormal};
pub use incidents::{Incident, Kind, News};
pub use labels::{KeptLabel, Label};
pub use notes::{Note, baselines};

/// Retention time of contacts, incidents and history \[ns\]. Resolution: a year and some, to compare seasons.
pub const KEPT_NS: i64 = 400 * 86_400_000_000_000;
/// Longest wait for another program that holds the file.
const WAIT: Duration = Duration::from_secs(2);
/// Version of the tables. A file of another version is rejected.
const VERSION: i64 = 1;

const TABLES: &str = "
    CREATE TABLE cells (cell TEXT PRIMARY KEY, seen_ns INTEGER NOT NULL, host TEXT NOT NULL, robot TEXT NOT NULL);
    CREATE TABLE contacts (
        cell TEXT NOT NULL, instance TEXT NOT NULL, number INTEGER NOT NULL,
        detector TEXT NOT NULL, kind TEXT NOT NULL, link TEXT,
        begin_ns INTEGER NOT NULL, onset_ns INTEGER NOT NULL, end_ns INTEGER, peak_force_n REAL,
        latched INTEGER NOT NULL, acknowledged_ns INTEGER, acknowledged_by TEXT, host TEXT, archive TEXT,
        PRIMARY KEY (cell, instance, number));
    CREATE INDEX contacts_by_time ON contacts (cell, onset_ns);
    CREATE TABLE incidents (
        id INTEGER PRIMARY KEY, cell TEXT NOT NULL, kind TEXT NOT NULL, place TEXT NOT NULL,
        severity INTEGER NOT NULL, words TEXT NOT NULL,
        opened_ns INTEGER NOT NULL, last_ns INTEGER NOT NULL, closed_ns INTEGER,
        count INTEGER NOT NULL, reopened INTEGER NOT NULL, acknowledged_ns INTEGER, acknowledged_by TEXT);
    CREATE INDEX incidents_by_cause ON incidents (cell, kind, place, last_ns);
    CREATE INDEX incidents_open ON incidents (closed_ns, last_ns);
    CREATE TABLE history (
        cell TEXT NOT NULL, joint TEXT NOT NULL, hour_ns INTEGER NOT NULL,
        minutes INTEGER NOT NULL, squares REAL NOT NULL, means REAL NOT NULL,
        PRIMARY KEY (cell, joint, hour_ns)) WITHOUT ROWID;
    CREATE TABLE notes (
        id INTEGER PRIMARY KEY, cell TEXT NOT NULL, at_ns INTEGER NOT NULL, by TEXT NOT NULL, text TEXT NOT NULL,
        baseline INTEGER NOT NULL);
    CREATE INDEX notes_by_cell ON notes (cell, at_ns);
";

/// An error of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// An error of SQLite.
    #[error("{path}: {source}{}", remedy(source))]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// SQLite's error.
        source: rusqlite::Error,
    },
    /// A file with tables of another version.
    #[error("{path} has the version {found}, this program reads {VERSION}; give another file")]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: i64,
    },
}

/// Returns the remedy that follows SQLite's error message.
fn remedy(error: &rusqlite::Error) -> &'static str {
    use rusqlite::ErrorCode as Code;
    match error.sqlite_error_code() {
        Some(Code::NotADatabase | Code::DatabaseCorrupt) => {
            "; move it away (`sqlite3 FILE .recover` may save a part) and begin with another file"
        }
        Some(Code::DatabaseBusy | Code::DatabaseLocked) => {
            "; another program holds it: end that one, or give another file"
        }
        Some(Code::CannotOpen) => "; is its folder there, and may it be written to?",
        Some(Code::DiskFull) => "; make room on its disk",
        Some(Code::ReadOnly) => "; it may not be written to",
        _ => "",
    }
}

/// An open store.
#[derive(Debug)]
pub struct Store {
    connection: Connection,
    path: PathBuf,
}

impl Store {
    /// Opens the file, and creates it if necessary.
    ///
    /// # Errors
    /// If it cannot be opened, or is not a store of a fleet host.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let failed = |source| StoreError::Sqlite {
            path: path.to_owned(),
            source,
        };
        let connection = Connection::open(path).map_err(failed)?;
        connection.busy_timeout(WAIT).map_err(failed)?;
        let found: i64 = connection
            .query_row("PRAGMA user_version", [], |row| row.get(0))
            .map_err(failed)?;
        let tables: i64 = connection
            .query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0))
            .map_err(failed)?;
        if found == 0 && tables == 0 {
            let made = format!("BEGIN; {TABLES} PRAGMA user_version = {VERSION}; COMMIT;");
            connection.execute_batch(&made).map_err(failed)?;
        } else if found != VERSION {
            let path = path.to_owned();
            return Err(StoreError::Version { path, found });
        }
        // A power cut may lose the last second, never the file.
        connection
            .execute_batch("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;")
            .map_err(failed)?;
        let later = [
            ("labels", labels::TABLE),
            ("heard", contacts::TABLES),
            ("arrivals", contacts::ARRIVALS),
            ("ended", cells::TABLE),
            ("believed", clock::TABLE),
        ];
        for (name, tables) in later {
            let text = "SELECT count(*) FROM sqlite_schema WHERE name = ?1";
            let has: bool = connection
                .query_row(text, [name], |row| row.get(0))
                .map_err(failed)?;
            if !has {
                connection.execute_batch(tables).map_err(failed)?;
            }
        }
        Ok(Self {
            connection,
            path: path.to_owned(),
        })
    }

    /// Opens the file again, for another thread.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub fn again(&self) -> Result<Self, StoreError> {
        Self::open(&self.path)
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Sets whether to wait for another program that holds the file. The default is to wait.
    pub fn waits_for_others(&self, waits: bool) {
        // This only sets a number, and does not fail.
        let _ = self
            .connection
            .busy_timeout(if waits { WAIT } else { Duration::ZERO });
    }

    /// Locks the file exclusively.
    ///
    /// # Errors
    /// If SQLite refuses.
    #[cfg(test)]
    pub fn hold(&self) -> Result<(), StoreError> {
        let held = self.connection.execute_batch("BEGIN EXCLUSIVE;");
        held.map_err(|error| self.failed(error))
    }

    /// Releases the lock.
    ///
    /// # Errors
    /// If SQLite refuses.
    #[cfg(test)]
    pub fn release(&self) -> Result<(), StoreError> {
        let released = self.connection.execute_batch("COMMIT;");
        released.map_err(|error| self.failed(error))
    }

    /// Checks that the file can be written.
    ///
    /// # Errors
    /// If it cannot.
    pub fn is_writable(&self) -> Result<(), StoreError> {
        let looked = self.connection.execute_batch("BEGIN IMMEDIATE; ROLLBACK;");
        looked.map_err(|error| self.failed(error))
    }

    fn failed(&self, source: rusqlite::Error) -> StoreError {
        let path = self.path.clone();
        StoreError::Sqlite { path, source }
    }

    /// Removes data older than the retention time.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn prune(&self, now_ns: i64) -> Result<(), StoreError> {
        let before = now_ns.saturating_sub(KEPT_NS);
        let texts = [
            "DELETE FROM contacts WHERE (cell, instance, number) IN
                (SELECT cell, instance, number FROM arrivals WHERE at_ns < ?1)",
            "DELETE FROM arrivals WHERE at_ns < ?1",
            "DELETE FROM heard WHERE at_ns < ?1",
            "DELETE FROM incidents WHERE last_ns < ?1",
            "DELETE FROM history WHERE hour_ns < ?1",
            "DELETE FROM labels WHERE at_ns < ?1",
            "DELETE FROM cells WHERE seen_ns < ?1",
            "DELETE FROM ended WHERE at_ns < ?1",
        ];
        for text in texts {
            let done = self.connection.execute(text, [before]);
            done.map_err(|error| self.failed(error))?;
        }
        Ok(())
    }

    /// Runs `work` as one transaction: all of it is stored, or nothing.
    ///
    /// # Errors
    /// The error of `work`, or if the file cannot be written.
    pub fn at_once(
        &self,
        work: impl FnOnce(&Self) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        // A transaction that begins with a read could not wait for another writer.
        let begin = TransactionBehavior::Immediate;
        let transaction = Transaction::new_unchecked(&self.connection, begin)
            .map_err(|error| self.failed(error))?;
        work(self)?;
        transaction.commit().map_err(|error| self.failed(error))
    }

    fn rows<T>(
        &self,
        text: &str,
        values: impl rusqlite::Params,
        read: impl FnMut(&rusqlite::Row<'_>) -> rusqlite::Result<T>,
    ) -> Result<Vec<T>, StoreError> {
        let mut statement = self
            .connection
            .prepare(text)
            .map_err(|error| self.failed(error))?;
        let rows = statement.query_map(values, read);
        let rows = rows.and_then(Iterator::collect);
        rows.map_err(|error| self.failed(error))
    }
}
