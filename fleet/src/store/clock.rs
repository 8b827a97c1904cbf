//! The time by which what is old is removed.
//!
//! Clocks are set wrong and set right again, and what is removed is gone. So a clock that jumps far ahead is believed only
//! after a day. The time that was believed last is kept in the file, so that a start is no way around that.

use std::time::{Duration, Instant};

use rusqlite::OptionalExtension as _;

use super::{Store, StoreError};

/// A file of before knows no time; one that does is read by programs of before.
pub(super) const TABLE: &str = "CREATE TABLE IF NOT EXISTS believed (at_ns INTEGER NOT NULL);";
/// A clock that is ahead by more than this of what was believed has jumped, or nobody was here for long \[ns\].
/// Resolution: what is kept for a year may go a week early.
const JUMP_NS: i64 = 7 * 86_400_000_000_000;
/// So long after a jump ahead the clock is believed.
/// Resolution: somebody looks at a plant once a day.
const BELIEVED_AFTER: Duration = Duration::from_hours(24);

/// Removes what is old.
#[derive(Debug)]
pub struct Aging {
    begin: Instant,
    /// Known once the file has been asked.
    steady: Option<Steady>,
}

impl Default for Aging {
    fn default() -> Self {
        Self {
            begin: Instant::now(),
            steady: None,
        }
    }
}

impl Aging {
    /// Removes from `store` what is older than it is kept, where the clock says `now_ns` \[ns since the epoch\].
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn prune(&mut self, store: &Store, now_ns: i64) -> Result<(), StoreError> {
        let running = self.begin.elapsed();
        let mut steady = match self.steady {
            Some(steady) => steady,
            None => Steady::new(store.believed_ns()?.unwrap_or(now_ns), running),
        };
        let believed_ns = steady.read(now_ns, running);
        self.steady = Some(steady);
        store.at_once(|store| {
            store.believe(believed_ns)?;
            store.prune(believed_ns)
        })
    }
}

/// The clock of this host, which is not believed at once when it jumps ahead.
#[derive(Debug, Clone, Copy)]
struct Steady {
    /// What was believed last \[ns since the epoch\], and when, by a clock that only runs.
    last: (i64, Duration),
    /// Since when it is not.
    ahead: Option<Duration>,
}

impl Steady {
    /// Since `believed_ns`, which was believed at `running`.
    fn new(believed_ns: i64, running: Duration) -> Self {
        Self {
            last: (believed_ns, running),
            ahead: None,
        }
    }

    /// The time as far as it is believed, where the clock says `now_ns` \[ns since the epoch\].
    fn read(&mut self, now_ns: i64, running: Duration) -> i64 {
        let passed = running.saturating_sub(self.last.1).as_nanos();
        let passed_ns = i64::try_from(passed).unwrap_or(i64::MAX);
        let steady_ns = self.last.0.saturating_add(passed_ns);
        if now_ns.saturating_sub(steady_ns) > JUMP_NS {
            let since = *self.ahead.get_or_insert(running);
            if running.saturating_sub(since) < BELIEVED_AFTER {
                return steady_ns;
            }
        }
        *self = Self::new(now_ns, running);
        now_ns
    }
}

impl Store {
    /// What was believed last \[ns since the epoch\]; nothing in a new file.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn believed_ns(&self) -> Result<Option<i64>, StoreError> {
        let text = "SELECT at_ns FROM believed";
        let found = self.connection.query_row(text, [], |row| row.get(0));
        found.optional().map_err(|error| self.failed(error))
    }

    /// This time is believed.
    ///
    /// # Errors
    /// If the file cannot be written.
    fn believe(&self, at_ns: i64) -> Result<(), StoreError> {
        for (text, values) in [
            ("DELETE FROM believed", vec![]),
            ("INSERT INTO believed VALUES (?1)", vec![at_ns]),
        ] {
            let done = self
                .connection
                .execute(text, rusqlite::params_from_iter(values));
            done.map_err(|error| self.failed(error))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR: Duration = Duration::from_hours(1);
    const HOUR_NS: i64 = 3_600_000_000_000;

    #[test]
    fn a_clock_that_jumps_ahead_is_believed_after_a_day() {
        let mut steady = Steady::new(0, Duration::ZERO);
        let mut after = |hours: u32, ahead_h: i64| {
            let now_ns = (i64::from(hours) + ahead_h) * HOUR_NS;
            steady.read(now_ns, hours * HOUR) / HOUR_NS
        };
        assert_eq!(after(5, 0), 5);
        assert_eq!(after(6, 17_520), 6);
        // It is set right, also backwards.
        assert_eq!(after(7, 0), 7);
        assert_eq!(after(8, -8), 0);
        assert_eq!(after(9, 17_520), 1);
        assert_eq!(after(32, 17_520), 24);
        assert_eq!(after(33, 17_520), 33 + 17_520);
        // A host that was away for a weekend is believed at once.
        assert_eq!(after(34, 17_520 + 60), 34 + 17_520 + 60);
    }
}
