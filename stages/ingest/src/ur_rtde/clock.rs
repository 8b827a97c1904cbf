//! Conversion of the controller's clock, which counts from its start, to the host's clock. Pure.

/// Step of the clock above which it is treated as set, or its controller as restarted \[ns\].
/// Physical: far above the delay of a network, far below the time that a controller takes to start.
const STEP_NS: i64 = 1_000_000_000;
/// Longest plausible time since a controller's start \[s\].
/// Physical: 30 years.
const LONGEST_S: f64 = 1e9;

/// Stamps packages, and counts missing ones.
#[derive(Debug)]
pub(super) struct Clock {
    /// Offset from the controller's time to the host's \[ns\].
    offset_ns: Option<i64>,
    connection: u64,
    newest_ns: i64,
    period_ns: i64,
    shortest_ns: Option<i64>,
    lost: u64,
}

impl Clock {
    /// Creates a clock for packages at this rate.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            offset_ns: None,
            connection: 0,
            newest_ns: 0,
            period_ns: (1e9 / rate_hz).round() as i64,
            shortest_ns: None,
            lost: 0,
        }
    }

    /// Returns the number of packages missing between others. It includes those of an interruption, unless the
    /// controller was restarted.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Returns the stamp \[ns since the epoch\] of a package received on this connection; `None` if its time is
    /// invalid. Differences of stamps are those of the controller's clock.
    pub fn stamp(&mut self, timestamp_s: f64, received_ns: i64, connection: u64) -> Option<i64> {
        if !(0.0..LONGEST_S).contains(&timestamp_s) {
            return None;
        }
        let time_ns = (timestamp_s * 1e9).round() as i64;
        let anew = received_ns - time_ns;
        let offset_ns = match self.offset_ns {
            Some(offset_ns) if time_ns < self.newest_ns - STEP_NS => {
                tracing::warn!("the controller's clock was set back: it was started again");
                self.newest_ns = time_ns;
                // A new connection may have corrected the offset already.
                if (offset_ns - anew).abs() > STEP_NS {
                    anew
                } else {
                    offset_ns
                }
            }
            Some(offset_ns)
                if connection != self.connection && (offset_ns - anew).abs() > STEP_NS =>
            {
                self.newest_ns = time_ns;
                anew
            }
            Some(offset_ns) => {
                self.count(time_ns);
                offset_ns
            }
            None => {
                self.newest_ns = time_ns;
                anew
            }
        };
        self.connection = connection;
        self.offset_ns = Some(offset_ns);
        Some(time_ns + offset_ns)
    }

    /// Counts the packages missing before this one. A controller that is slower than requested sends at its own rate,
    /// which is that of the shortest step.
    fn count(&mut self, time_ns: i64) {
        let step_ns = time_ns - self.newest_ns;
        if step_ns <= 0 {
            return;
        }
        self.newest_ns = time_ns;
        let shortest_ns = self.shortest_ns.map_or(step_ns, |ns| ns.min(step_ns));
        self.shortest_ns = Some(shortest_ns);
        // Tolerance of a tenth of a period: stamps are rounded.
        let period_ns = self.period_ns.max(shortest_ns);
        let periods = (step_ns + period_ns / 10) / period_ns;
        self.lost += u64::try_from(periods - 1).unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

    #[test]
    fn stamps_are_the_controllers_whatever_the_network_does() {
        let mut clock = Clock::new(500.0);
        let first = clock.stamp(100.0, EPOCH_NS, 1);
        assert_eq!(first, Some(EPOCH_NS));
        // A late reception does not make the stamp late.
        let late = clock.stamp(100.002, EPOCH_NS + 30_000_000, 1);
        assert_eq!(late, Some(EPOCH_NS + 2_000_000));
        assert_eq!(clock.lost(), 0);
        let after_a_hole = clock.stamp(100.010, EPOCH_NS + 31_000_000, 1);
        assert_eq!(after_a_hole, Some(EPOCH_NS + 10_000_000));
        assert_eq!(clock.lost(), 3);
        // A new connection to the same controller continues its time.
        let again = clock.stamp(101.010, EPOCH_NS + 1_010_000_000, 2);
        assert_eq!(again, Some(EPOCH_NS + 1_010_000_000));
        assert_eq!(clock.lost(), 502);
    }

    #[test]
    fn a_controller_that_was_started_again_begins_anew() {
        let mut clock = Clock::new(500.0);
        clock.stamp(5000.0, EPOCH_NS, 1);
        let later_ns = EPOCH_NS + 60_000_000_000;
        assert_eq!(clock.stamp(20.0, later_ns, 2), Some(later_ns));
        let next = clock.stamp(20.002, later_ns + 5, 2);
        assert_eq!(next, Some(later_ns + 2_000_000));
        assert_eq!(clock.lost(), 0);
    }

    #[test]
    fn a_slower_controller_loses_nothing() {
        let mut clock = Clock::new(500.0);
        for i in 0..100 {
            let s = 1.0 + f64::from(i) * 0.008;
            assert!(clock.stamp(s, EPOCH_NS, 1).is_some());
        }
        assert_eq!(clock.lost(), 0);
    }

    #[test]
    fn what_is_no_time_has_no_stamp() {
        let mut clock = Clock::new(500.0);
        for s in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            assert_eq!(clock.stamp(s, EPOCH_NS, 1), None);
        }
    }
}
