//! Incidents: one for each cause, also if it recurs.

use rusqlite::{OptionalExtension as _, params};
use serde::Serialize;

use super::{Store, StoreError};
use crate::wall::Severity;

/// Time within which a recurrence belongs to the same incident \[ns\]. Resolution: a shift looks at it once.
pub const REOPEN_NS: i64 = 600_000_000_000;

/// Kind of cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A contact with the robot.
    Contact,
    /// A change of the arm.
    Change,
    /// A stale or unknown cell.
    Silence,
    /// A loss of samples.
    Loss,
}

impl Kind {
    /// Returns its name in the file.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Contact => "contact",
            Self::Change => "change",
            Self::Silence => "silence",
            Self::Loss => "loss",
        }
    }
}

/// An occurrence of an incident.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct News {
    /// The cell.
    pub cell: String,
    /// The kind of the cause.
    pub kind: Kind,
    /// Subject that distinguishes it from other causes of the kind: a detector, a stage, an effect with its joints.
    pub place: String,
    /// Its severity.
    pub severity: Severity,
    /// Its description.
    pub words: String,
    /// Its time \[ns since the epoch\].
    pub at_ns: i64,
}

/// An incident.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Incident {
    /// Its number.
    pub id: i64,
    /// The cell.
    pub cell: String,
    /// The kind of the cause.
    pub kind: String,
    /// Its severity.
    pub severity: Severity,
    /// Description of its newest occurrence.
    pub words: String,
    /// Start time \[ns since the epoch\].
    pub opened_ns: i64,
    /// Time of the newest occurrence \[ns since the epoch\].
    pub last_ns: i64,
    /// End time; `None` while it lasts \[ns since the epoch\].
    pub closed_ns: Option<i64>,
    /// Number of occurrences.
    pub count: i64,
    /// Number of times it was reopened.
    pub reopened: i64,
    /// Time of the acknowledgement \[ns since the epoch\].
    pub acknowledged_ns: Option<i64>,
    /// User who acknowledged it.
    pub acknowledged_by: Option<String>,
}

fn number(severity: Severity) -> i64 {
    match severity {
        Severity::Critical => 3,
        Severity::Serious => 2,
        Severity::Notice => 1,
        Severity::Good => 0,
    }
}

fn severity(number: i64) -> Severity {
    match number {
        3 => Severity::Critical,
        2 => Severity::Serious,
        1 => Severity::Notice,
        _ => Severity::Good,
    }
}

impl Store {
    /// Adds to the open incident of this cause, reopens one that ended less than 10 minutes ago, or begins one.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn raise(&self, news: &News) -> Result<(), StoreError> {
        let failed = |error| self.failed(error);
        let text =
            "SELECT id, closed_ns FROM incidents WHERE cell = ?1 AND kind = ?2 AND place = ?3
                    ORDER BY closed_ns IS NOT NULL, id DESC LIMIT 1";
        let cause = params![news.cell, news.kind.as_str(), news.place];
        let last: Option<(i64, Option<i64>)> = self
            .connection
            .query_row(text, cause, |row| Ok((row.get(0)?, row.get(1)?)))
            .optional()
            .map_err(failed)?;
        let same = last.filter(|(_, closed_ns)| {
            // A stamp long before the end is of a clock that was set back, and begins another incident, too.
            closed_ns.is_none_or(|closed_ns| {
                let apart_ns = news.at_ns.saturating_sub(closed_ns);
                apart_ns.saturating_abs() < REOPEN_NS
            })
        });
        if let Some((id, closed_ns)) = same {
            let text = "UPDATE incidents SET count = count + 1, last_ns = max(last_ns, ?2), words = ?3,
                            severity = max(severity, ?4), closed_ns = NULL, reopened = reopened + ?5,
                            acknowledged_ns = NULL, acknowledged_by = NULL WHERE id = ?1";
            let again = i64::from(closed_ns.is_some());
            let values = params![id, news.at_ns, news.words, number(news.severity), again];
            self.connection.execute(text, values).map_err(failed)?;
        } else {
            let text = "INSERT INTO incidents
                            (cell, kind, place, severity, words, opened_ns, last_ns, count, reopened)
                            VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?6, 1, 0)";
            let values = params![
                news.cell,
                news.kind.as_str(),
                news.place,
                number(news.severity),
                news.words,
                news.at_ns
            ];
            self.connection.execute(text, values).map_err(failed)?;
        }
        Ok(())
    }

    /// Updates the open incident of this cause without counting an occurrence. Returns whether there is one.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn revise(&self, news: &News) -> Result<bool, StoreError> {
        let text = "UPDATE incidents SET words = ?4, severity = max(severity, ?5)
                    WHERE cell = ?1 AND kind = ?2 AND place = ?3 AND closed_ns IS NULL";
        let (kind, severity) = (news.kind.as_str(), number(news.severity));
        let values = params![news.cell, kind, news.place, news.words, severity];
        let done = self.connection.execute(text, values);
        done.map(|rows| rows > 0)
            .map_err(|error| self.failed(error))
    }

    /// Closes the open incident of this cause.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn close(&self, cell: &str, kind: Kind, place: &str, at_ns: i64) -> Result<(), StoreError> {
        let text = "UPDATE incidents SET closed_ns = ?4
                    WHERE cell = ?1 AND kind = ?2 AND place = ?3 AND closed_ns IS NULL";
        let values = params![cell, kind.as_str(), place, at_ns];
        let done = self.connection.execute(text, values);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Closes the open contacts without a latch of a cell whose run has ended normally, because their end will not be
    /// reported.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn run_ended(&self, cell: &str, at_ns: i64) -> Result<(), StoreError> {
        let text =
            "UPDATE incidents SET closed_ns = ?4, words = words || '; it lasted when the run ended'
                    WHERE cell = ?1 AND kind = ?2 AND severity < ?3 AND closed_ns IS NULL";
        let (kind, latched) = (Kind::Contact.as_str(), number(Severity::Critical));
        let done = self
            .connection
            .execute(text, params![cell, kind, latched, at_ns]);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Acknowledges the incidents of a cell. This also closes changes of the arm, whose end is not reported
    /// otherwise.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn acknowledge(&self, cell: &str, by: &str, at_ns: i64) -> Result<(), StoreError> {
        let text = "UPDATE incidents SET acknowledged_ns = ?2, acknowledged_by = ?3,
                    closed_ns = CASE kind WHEN 'change' THEN ?2 ELSE closed_ns END
                    WHERE cell = ?1 AND acknowledged_ns IS NULL";
        let done = self.connection.execute(text, params![cell, at_ns, by]);
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Returns the publisher instance of a cell whose latch is not acknowledged, and the start of its incident \[ns
    /// since the epoch\]; `None` if the newest contact is not latched.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn latched(&self, cell: &str) -> Result<Option<(String, i64)>, StoreError> {
        let text = "SELECT instance, opened_ns FROM
                    (SELECT * FROM contacts WHERE cell = ?1 ORDER BY onset_ns DESC LIMIT 1) AS contact
                    JOIN incidents ON incidents.cell = ?1 AND incidents.kind = ?2 AND place = detector
                    WHERE latched AND contact.acknowledged_ns IS NULL
                    AND closed_ns IS NULL AND incidents.acknowledged_ns IS NULL ORDER BY opened_ns LIMIT 1";
        let values = params![cell, Kind::Contact.as_str()];
        let row = |row: &rusqlite::Row<'_>| Ok((row.get(0)?, row.get(1)?));
        let found = self.connection.query_row(text, values, row).optional();
        found.map_err(|error| self.failed(error))
    }

    /// Returns the incidents of a cell, or of all cells: the open ones first, then the newest.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn incidents(&self, cell: Option<&str>, most: u32) -> Result<Vec<Incident>, StoreError> {
        let text = "SELECT id, cell, kind, severity, words, opened_ns, last_ns, closed_ns, count, reopened,
                    acknowledged_ns, acknowledged_by FROM incidents WHERE ?1 IS NULL OR cell = ?1
                    ORDER BY closed_ns IS NOT NULL, last_ns DESC LIMIT ?2";
        self.rows(text, params![cell, most], |row| {
            Ok(Incident {
                id: row.get(0)?,
                cell: row.get(1)?,
                kind: row.get(2)?,
                severity: severity(row.get(3)?),
                words: row.get(4)?,
                opened_ns: row.get(5)?,
                last_ns: row.get(6)?,
                closed_ns: row.get(7)?,
                count: row.get(8)?,
                reopened: row.get(9)?,
                acknowledged_ns: row.get(10)?,
                acknowledged_by: row.get(11)?,
            })
        })
    }
}
