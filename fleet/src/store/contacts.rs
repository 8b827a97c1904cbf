//! Contacts, and the records received from the cells.

use rusqlite::{OptionalExtension as _, params};
use serde::Serialize;
use tauscope_publish::message::ContactMessage;

use super::{Store, StoreError};

/// Table of received records. It was added later: older files lack it, and older programs ignore it.
pub(super) const TABLES: &str = "
    CREATE TABLE IF NOT EXISTS heard (
        cell TEXT NOT NULL, instance TEXT NOT NULL, number INTEGER NOT NULL, at_ns INTEGER NOT NULL,
        PRIMARY KEY (cell, instance, number)) WITHOUT ROWID;
";
/// Table of arrival times of contacts by the clock of the fleet host. Their own stamps are by the cell's clock, which
/// may be wrong.
pub(super) const ARRIVALS: &str = "
    CREATE TABLE IF NOT EXISTS arrivals (
        cell TEXT NOT NULL, instance TEXT NOT NULL, number INTEGER NOT NULL, at_ns INTEGER NOT NULL,
        PRIMARY KEY (cell, instance, number)) WITHOUT ROWID;
    INSERT INTO arrivals SELECT cell, instance, number, onset_ns FROM contacts;
";

/// A stored contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KeptContact {
    /// The cell's report of it.
    #[serde(flatten)]
    pub contact: ContactMessage,
    /// The cell's computer at that time.
    pub host: String,
    /// Path of the cell's recorded archive; `None` without a recorder.
    pub archive: Option<String>,
}

/// New information in a record of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Said {
    /// A new contact.
    New,
    /// More about a known contact.
    More,
    /// Nothing new.
    Nothing,
}

fn signed(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

impl Store {
    /// Stores that the record `number` of a publisher instance was received at `at_ns`. Returns whether it is the
    /// first time.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn hear(
        &self,
        cell: &str,
        instance: &str,
        number: u64,
        at_ns: i64,
    ) -> Result<bool, StoreError> {
        let text = "INSERT OR IGNORE INTO heard VALUES (?1, ?2, ?3, ?4)";
        let values = params![cell, instance, signed(number), at_ns];
        let done = self.connection.execute(text, values);
        done.map(|rows| rows > 0)
            .map_err(|error| self.failed(error))
    }

    /// Stores or updates a contact, received at `at_ns`. Returns what was new.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn contact(
        &self,
        cell: &str,
        instance: &str,
        contact: &ContactMessage,
        host: &str,
        archive: Option<&str>,
        at_ns: i64,
    ) -> Result<Said, StoreError> {
        let number = signed(contact.number);
        let known = "SELECT 1 FROM contacts WHERE cell = ?1 AND instance = ?2 AND number = ?3";
        let key = params![cell, instance, number];
        let known: Option<i64> = self
            .connection
            .query_row(known, key, |row| row.get(0))
            .optional()
            .map_err(|error| self.failed(error))?;
        // Estimates made during the contact do not overwrite the result at its end.
        let text =
            "INSERT INTO contacts VALUES (?1,?2,?3,?4,?5,?6,?7,?8,?9,?10,?11,?12,?13,?14,?15)
                    ON CONFLICT DO UPDATE SET kind = ?5, link = ?6, end_ns = coalesce(?9, end_ns),
                    peak_force_n = ?10, latched = max(latched, ?11),
                    acknowledged_ns = coalesce(?12, acknowledged_ns),
                    acknowledged_by = coalesce(?13, acknowledged_by)
                    WHERE (end_ns IS NULL OR ?9 IS NOT NULL) AND (kind IS NOT ?5 OR link IS NOT ?6
                    OR end_ns IS NOT coalesce(?9, end_ns) OR peak_force_n IS NOT ?10 OR latched < ?11
                    OR acknowledged_ns IS NOT coalesce(?12, acknowledged_ns)
                    OR acknowledged_by IS NOT coalesce(?13, acknowledged_by))";
        let values = params![
            cell,
            instance,
            number,
            contact.detector,
            contact.kind,
            contact.link,
            contact.begin_ns,
            contact.onset_ns,
            contact.end_ns,
            contact.peak_force_n,
            contact.latched,
            contact.acknowledged_ns,
            contact.acknowledged_by,
            host,
            archive,
        ];
        let done = self.connection.execute(text, values);
        let rows = done.map_err(|error| self.failed(error))?;
        let text = "INSERT OR IGNORE INTO arrivals VALUES (?1, ?2, ?3, ?4)";
        let values = params![cell, instance, number, at_ns];
        let done = self.connection.execute(text, values);
        done.map_err(|error| self.failed(error))?;
        Ok(match (known, rows) {
            (_, 0) => Said::Nothing,
            (None, _) => Said::New,
            (Some(_), _) => Said::More,
        })
    }

    /// Returns whether this is the newest contact of its detector and publisher instance.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn is_newest(
        &self,
        cell: &str,
        instance: &str,
        contact: &ContactMessage,
    ) -> Result<bool, StoreError> {
        let text = "SELECT NOT EXISTS (SELECT 1 FROM contacts
                    WHERE cell = ?1 AND instance = ?2 AND number > ?3 AND detector = ?4)";
        let values = params![cell, instance, signed(contact.number), contact.detector];
        let found = self.connection.query_row(text, values, |row| row.get(0));
        found.map_err(|error| self.failed(error))
    }

    /// Returns the newest contacts of a cell.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn contacts(&self, cell: &str, most: u32) -> Result<Vec<KeptContact>, StoreError> {
        let text = "SELECT number, detector, kind, link, begin_ns, onset_ns, end_ns, peak_force_n, latched,
                    acknowledged_ns, acknowledged_by, coalesce(host, ''), archive
                    FROM contacts WHERE cell = ?1 ORDER BY onset_ns DESC LIMIT ?2";
        self.rows(text, params![cell, most], |row| {
            let number: i64 = row.get(0)?;
            Ok(KeptContact {
                contact: ContactMessage {
                    number: u64::try_from(number).unwrap_or(0),
                    detector: row.get(1)?,
                    kind: row.get(2)?,
                    link: row.get(3)?,
                    // Only the newest message has a second link; the tables store the first one.
                    other_link: None,
                    begin_ns: row.get(4)?,
                    onset_ns: row.get(5)?,
                    end_ns: row.get(6)?,
                    peak_force_n: row.get(7)?,
                    latched: row.get(8)?,
                    acknowledged_ns: row.get(9)?,
                    acknowledged_by: row.get(10)?,
                },
                host: row.get(11)?,
                archive: row.get(12)?,
            })
        })
    }
}
