//! Clock offset of another computer, measured as in the Network Time Protocol (D. Mills et al., RFC 5905, 2010,
//! sections 8 and 10), over any transport that carries a request and its response.

use std::collections::VecDeque;

/// Measurements in the clock filter, of which the one with the smallest uncertainty is used (RFC 5905, section 10).
const KEPT: usize = 8;
/// Largest drift of an undisciplined clock \[ns of error per second of age\].
/// Physical: PHI of RFC 5905, section 4.
const DRIFT_NS_PER_S: f64 = 15_000.0;

/// The four timestamps of a request and its response (RFC 5905, section 8).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RoundTrip {
    /// T1: departure of the request, by this computer's clock \[ns since the epoch\].
    pub asked_ns: i64,
    /// T2: arrival of the request, by the other clock \[ns since the epoch\].
    pub received_ns: i64,
    /// T3: departure of the response, by the other clock \[ns since the epoch\].
    pub answered_ns: i64,
    /// T4: arrival of the response, by this computer's clock \[ns since the epoch\].
    pub back_ns: i64,
}

/// Offset of another clock from this computer's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Offset {
    /// The other clock minus this one \[ns\].
    pub ahead_ns: i64,
    /// Bound on the error of `ahead_ns` \[ns\].
    pub uncertainty_ns: i64,
}

impl RoundTrip {
    /// Returns the offset θ = ((T2 - T1) + (T3 - T4)) / 2. Its error is at most half the round-trip delay
    /// δ = (T4 - T1) - (T3 - T2), however asymmetric the path. `None` for inconsistent timestamps, for example where
    /// a clock was set during the exchange.
    pub fn offset(&self) -> Option<Offset> {
        let [t1, t2, t3, t4] = [
            self.asked_ns,
            self.received_ns,
            self.answered_ns,
            self.back_ns,
        ]
        .map(i128::from);
        let way = (t4 - t1) - (t3 - t2);
        if t3 < t2 || way < 0 {
            return None;
        }
        Some(Offset {
            ahead_ns: i64::try_from(i128::midpoint(t2 - t1, t3 - t4)).ok()?,
            uncertainty_ns: i64::try_from((way + 1) / 2).ok()?,
        })
    }
}

impl Offset {
    /// Adds the drift over `age_ms` to the uncertainty.
    fn aged(self, age_ms: u64) -> Self {
        let drift_ns = age_ms as f64 * 1e-3 * DRIFT_NS_PER_S;
        Self {
            uncertainty_ns: self.uncertainty_ns.saturating_add(drift_ns as i64),
            ..self
        }
    }

    /// Whether the two uncertainty intervals overlap.
    fn agrees(self, other: Self) -> bool {
        let apart = self.ahead_ns.abs_diff(other.ahead_ns);
        let most = self.uncertainty_ns.saturating_add(other.uncertainty_ns);
        apart <= most.unsigned_abs()
    }

    /// Whether the clocks differ by more than `limit_ns` throughout the uncertainty interval.
    pub fn exceeds(self, limit_ns: i64) -> bool {
        let least = self.ahead_ns.saturating_abs();
        least.saturating_sub(self.uncertainty_ns) > limit_ns
    }
}

/// The latest measurements, of which the one with the smallest uncertainty is used. A slow network increases the
/// uncertainty of a measurement, but the true offset stays within it.
#[derive(Debug, Clone, Default)]
pub struct ClockFilter {
    /// Offsets with their times of measurement \[ms\].
    kept: VecDeque<(Offset, u64)>,
}

impl ClockFilter {
    /// Adds a measurement made at `now_ms` of a monotonic clock. Discards older measurements that contradict it,
    /// because a clock was set since then.
    pub fn note(&mut self, new: Offset, now_ms: u64) {
        self.kept
            .retain(|(old, at_ms)| old.aged(now_ms.saturating_sub(*at_ms)).agrees(new));
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back((new, now_ms));
    }

    /// Returns the measurement with the smallest uncertainty, including the drift since then.
    pub fn best(&self, now_ms: u64) -> Option<Offset> {
        let aged = self.kept.iter();
        aged.map(|(offset, at_ms)| offset.aged(now_ms.saturating_sub(*at_ms)))
            .min_by_key(|offset| offset.uncertainty_ns)
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether there are no measurements.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// A request sent at 0 to a clock that is `ahead`, with both path delays and the processing time `between` them.
    fn trip(ahead: i64, there: i64, between: i64, back: i64) -> RoundTrip {
        RoundTrip {
            asked_ns: 0,
            received_ns: there + ahead,
            answered_ns: there + between + ahead,
            back_ns: there + between + back,
        }
    }

    #[test]
    fn the_truth_is_within_the_uncertainty_however_unequal_the_ways_are() {
        for ahead in [-340 * MS, 0, 340 * MS] {
            for (there, back) in [(MS, MS), (0, 50 * MS), (200 * MS, 3 * MS)] {
                let offset = trip(ahead, there, 7 * MS, back).offset().unwrap();
                let error = offset.ahead_ns.abs_diff(ahead);
                assert!(error <= offset.uncertainty_ns.unsigned_abs(), "{offset:?}");
                assert_eq!(offset.uncertainty_ns, i64::midpoint(there, back));
            }
        }
    }

    #[test]
    fn times_that_cannot_be_are_no_measurement() {
        assert_eq!(trip(0, MS, -MS, MS).offset(), None);
        assert_eq!(trip(0, MS, MS, -5 * MS).offset(), None);
        let wild = RoundTrip {
            asked_ns: i64::MIN,
            received_ns: i64::MAX,
            answered_ns: i64::MAX,
            back_ns: i64::MIN,
        };
        assert_eq!(wild.offset(), None);
    }

    #[test]
    fn the_fastest_answer_counts_until_its_age_outweighs_it() {
        let mut filter = ClockFilter::default();
        filter.note(trip(MS, MS, 0, MS).offset().unwrap(), 0);
        filter.note(trip(MS, 80 * MS, 0, 0).offset().unwrap(), 1_000);
        assert_eq!(filter.best(1_000).unwrap().ahead_ns, MS);
        // 15 us/s of drift: after an hour the first measurement is as uncertain as a new one of 55 ms.
        filter.note(trip(MS, 20 * MS, 0, 0).offset().unwrap(), 3_600_000);
        assert_eq!(filter.best(3_600_000).unwrap().uncertainty_ns, 10 * MS);
    }

    #[test]
    fn a_clock_that_was_set_is_believed_at_once() {
        let mut filter = ClockFilter::default();
        filter.note(trip(0, MS, 0, MS).offset().unwrap(), 0);
        filter.note(trip(340 * MS, 9 * MS, 0, MS).offset().unwrap(), 1_000);
        let now = filter.best(1_000).unwrap();
        assert_eq!(filter.len(), 1);
        assert!(now.exceeds(100 * MS) && !now.exceeds(340 * MS), "{now:?}");
    }
}
