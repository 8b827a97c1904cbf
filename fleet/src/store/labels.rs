//! Labels that users have written into a cell's archive from the page, with the contacts to which they refer.

use rusqlite::params;
use serde::Serialize;

use super::{Store, StoreError};

/// Table of labels. It was added later: older files lack it, and older programs ignore it.
pub(super) const TABLE: &str = "
    CREATE TABLE IF NOT EXISTS labels (
        id INTEGER PRIMARY KEY, cell TEXT NOT NULL, at_ns INTEGER NOT NULL, stamp_ns INTEGER NOT NULL,
        by TEXT NOT NULL, text TEXT NOT NULL, onset_ns INTEGER, incident INTEGER);
    CREATE INDEX IF NOT EXISTS labels_by_cell ON labels (cell, at_ns);
";
/// Longest time from a contact to a label that refers to it \[ns\].
/// Resolution: a contact is investigated within a day.
const OF_CONTACT_NS: i64 = 86_400_000_000_000;

/// A text that a user has written into the archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Label {
    /// Time by the clock of the fleet host \[ns since the epoch\].
    pub at_ns: i64,
    /// Stamp of the sample that carries it \[ns since the epoch\].
    pub stamp_ns: i64,
    /// The user.
    pub by: String,
    /// The text.
    pub text: String,
}

/// A stored label, with the contact and the incident to which it refers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeptLabel {
    /// The label.
    #[serde(flatten)]
    pub label: Label,
    /// Onset of the contact; `None` without one \[ns since the epoch\].
    pub onset_ns: Option<i64>,
    /// Number of the incident; `None` without one.
    pub incident: Option<i64>,
}

impl Store {
    /// Stores a label that a cell has accepted, with the cell's newest contact and the incident of that.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn label(&self, cell: &str, label: &Label) -> Result<(), StoreError> {
        let text = "INSERT INTO labels (cell, at_ns, stamp_ns, by, text, onset_ns, incident)
                    SELECT ?1, ?2, ?3, ?4, ?5, contact.onset_ns,
                        (SELECT id FROM incidents WHERE cell = ?1 AND kind = 'contact' AND place = contact.detector
                         ORDER BY last_ns DESC, id DESC LIMIT 1)
                    FROM (SELECT 1) LEFT JOIN
                        (SELECT onset_ns, detector FROM contacts
                         WHERE cell = ?1 AND onset_ns <= ?3 AND onset_ns > ?6
                         ORDER BY onset_ns DESC LIMIT 1) AS contact";
        let Label {
            at_ns,
            stamp_ns,
            by,
            text: written,
        } = label;
        let since_ns = stamp_ns.saturating_sub(OF_CONTACT_NS);
        let values = params![cell, at_ns, stamp_ns, by, written, since_ns];
        let done = self.connection.execute(text, values);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Returns the newest labels of a cell, or of all cells.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn labels(&self, cell: Option<&str>, most: u32) -> Result<Vec<KeptLabel>, StoreError> {
        let text = "SELECT at_ns, stamp_ns, by, text, onset_ns, incident FROM labels
                    WHERE ?1 IS NULL OR cell = ?1 ORDER BY at_ns DESC, id DESC LIMIT ?2";
        self.rows(text, params![cell, most], |row| {
            Ok(KeptLabel {
                label: Label {
                    at_ns: row.get(0)?,
                    stamp_ns: row.get(1)?,
                    by: row.get(2)?,
                    text: row.get(3)?,
                },
                onset_ns: row.get(4)?,
                incident: row.get(5)?,
            })
        })
    }
}
