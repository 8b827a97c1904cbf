//! The time by which old data are removed.
//!
//! A clock may be set wrong and corrected later, but removed data are lost. So a clock that jumps far ahead is
//! accepted only after a day. The last accepted time is stored in the file, so that a restart does not bypass this
//! delay.

use std::time::{Duration, Instant};

use rusqlite::OptionalExtension as _;

use super::{Store, StoreError};

/// Table of the accepted time. It was added later: older files lack it, and older programs ignore it.
pub(super) const TABLE: &str = "CREATE TABLE IF NOT EXISTS believed (at_ns INTEGER NOT NULL);";
/// Largest advance over the accepted time without a jump of the clock or a long time off \[ns\].
/// Resolution: data kept for a year may be removed a week early.
const JUMP_NS: i64 = 7 * 86_400_000_000_000;
/// Delay after which a clock that jumped ahead is accepted.
/// Resolution: somebody looks at a plant once a day.
const BELIEVED_AFTER: Duration = Duration::from_hours(24);

/// Periodic removal of old data.
#[derive(Debug)]
pub struct Aging {
    begin: Instant,
    /// `None` until the file has been read.
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
    /// Removes data older than the retention time from `store`, at the clock time `now_ns` \[ns since the epoch\].
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

/// The clock of this host, with a delay before a jump ahead is accepted.
#[derive(Debug, Clone, Copy)]
struct Steady {
    /// Last accepted time \[ns since the epoch\], and the monotonic time of its acceptance.
    last: (i64, Duration),
    /// Monotonic time since which the clock is ahead and not accepted.
    ahead: Option<Duration>,
}

impl Steady {
    /// Creates a clock with the time `believed_ns`, accepted at the monotonic time `running`.
    fn new(believed_ns: i64, running: Duration) -> Self {
        Self {
            last: (believed_ns, running),
            ahead: None,
        }
    }

    /// Returns the accepted time at the clock time `now_ns` \[ns since the epoch\].
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
    /// Returns the last accepted time \[ns since the epoch\]; `None` in a new file.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn believed_ns(&self) -> Result<Option<i64>, StoreError> {
        let text = "SELECT at_ns FROM believed";
        let found = self.connection.query_row(text, [], |row| row.get(0));
        found.optional().map_err(|error| self.failed(error))
    }

    /// Stores the accepted time.
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
        // The clock is corrected, also backwards.
        assert_eq!(after(7, 0), 7);
        assert_eq!(after(8, -8), 0);
        assert_eq!(after(9, 17_520), 1);
        assert_eq!(after(32, 17_520), 24);
        assert_eq!(after(33, 17_520), 33 + 17_520);
        // The clock of a host that was off for a weekend is accepted at once.
        assert_eq!(after(34, 17_520 + 60), 34 + 17_520 + 60);
    }
}
