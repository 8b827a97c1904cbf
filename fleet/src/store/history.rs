//! The residual by joint over weeks, and the normal residual of a cell.

use rusqlite::params;
use serde::Serialize;

use super::{Store, StoreError};

const HOUR_NS: i64 = 3_600_000_000_000;
const DAY_NS: i64 = 24 * HOUR_NS;
/// Minimum number of minutes of a normal residual. Resolution: an hour covers a warm arm and its program.
const NORMAL_MINUTES: i64 = 60;
/// Hours after a baseline from which the normal residual is learned. Resolution: a day and a night.
const NORMAL_HOURS: u32 = 24;

/// A joint's residual on one day \[effort unit\].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Day {
    /// The joint.
    pub joint: String,
    /// 00:00 UTC \[ns since the epoch\].
    pub day_ns: i64,
    /// Root mean square of the day.
    pub rms: f64,
    /// The quietest hour.
    pub low: f64,
    /// The loudest hour.
    pub high: f64,
    /// Mean: the joint's offset.
    pub mean: f64,
    /// Number of minutes used.
    pub minutes: i64,
}

/// Normal residual of a joint \[effort unit\].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointNormal {
    /// The joint.
    pub joint: String,
    /// Root mean square of the residual.
    pub rms: f64,
}

fn root(square: f64) -> f64 {
    square.max(0.0).sqrt()
}

impl Store {
    /// Adds a minute of a joint's residual \[effort unit\].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn minute(
        &self,
        cell: &str,
        joint: &str,
        at_ns: i64,
        rms: f64,
        mean: f64,
    ) -> Result<(), StoreError> {
        let hour_ns = at_ns - at_ns.rem_euclid(HOUR_NS);
        let text = "INSERT INTO history VALUES (?1, ?2, ?3, 1, ?4, ?5) ON CONFLICT DO UPDATE
                    SET minutes = minutes + 1, squares = squares + ?4, means = means + ?5";
        let statement = self.connection.prepare(text);
        let values = params![cell, joint, hour_ns, rms * rms, mean];
        let done = statement.and_then(|mut statement| statement.execute(values));
        done.map(|_| ()).map_err(|error| self.failed(error))
    }

    /// Returns a cell's residual by day and joint since `since_ns`.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn days(&self, cell: &str, since_ns: i64) -> Result<Vec<Day>, StoreError> {
        let text = "SELECT joint, hour_ns - hour_ns % ?3 AS day, sum(squares) / sum(minutes),
                    min(squares / minutes), max(squares / minutes),
                    sum(means) / sum(minutes), sum(minutes)
                    FROM history WHERE cell = ?1 AND hour_ns >= ?2 GROUP BY joint, day ORDER BY joint, day";
        self.rows(text, params![cell, since_ns, DAY_NS], |row| {
            Ok(Day {
                joint: row.get(0)?,
                day_ns: row.get(1)?,
                rms: root(row.get(2)?),
                low: root(row.get(3)?),
                high: root(row.get(4)?),
                mean: row.get(5)?,
                minutes: row.get(6)?,
            })
        })
    }

    /// Returns the stamp of the newest baseline of a cell: a note that from then on it is another arm.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn baseline_ns(&self, cell: &str) -> Result<Option<i64>, StoreError> {
        let text = "SELECT max(at_ns) FROM notes WHERE cell = ?1 AND baseline";
        let found = self.connection.query_row(text, [cell], |row| row.get(0));
        found.map_err(|error| self.failed(error))
    }

    /// Returns the normal residual of a cell, learned over the first day after the newest baseline. A joint with less
    /// than an hour of data is omitted.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn normals(&self, cell: &str) -> Result<Vec<JointNormal>, StoreError> {
        let since_ns = self.baseline_ns(cell)?.unwrap_or(0);
        // The hour of the baseline itself contains minutes from before it.
        let text = "SELECT joint, sum(squares) / sum(minutes) FROM
                    (SELECT *, row_number() OVER (PARTITION BY joint ORDER BY hour_ns) AS place
                     FROM history WHERE cell = ?1 AND hour_ns >= ?2)
                    WHERE place <= ?3 GROUP BY joint HAVING sum(minutes) >= ?4 ORDER BY joint";
        let values = params![cell, since_ns, NORMAL_HOURS, NORMAL_MINUTES];
        self.rows(text, values, |row| {
            Ok(JointNormal {
                joint: row.get(0)?,
                rms: root(row.get(1)?),
            })
        })
    }
}
