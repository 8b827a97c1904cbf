//! How far the clock of another computer is ahead of this one's: the measurement of the Network Time Protocol (D. Mills
//! et al., RFC 5905, 2010, sections 8 and 10), over whatever carries a question and its answer.

use std::collections::VecDeque;

/// Measurements that are kept, of which the surest counts: the clock filter's eight (RFC 5905, section 10).
const KEPT: usize = 8;
/// Physical: a clock that nobody keeps drifts by up to so much \[ns of error a second of age\] (PHI, RFC 5905, section 4).
const DRIFT_NS_PER_S: f64 = 15_000.0;

/// A question and its answer: the four times of section 8.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RoundTrip {
    /// When it was asked, by this computer's clock \[ns since the epoch\].
    pub asked_ns: i64,
    /// When the question came, by the other's clock \[ns since the epoch\].
    pub received_ns: i64,
    /// When the answer left, by the other's clock \[ns since the epoch\].
    pub answered_ns: i64,
    /// When the answer came, by this computer's clock \[ns since the epoch\].
    pub back_ns: i64,
}

/// How far another clock is ahead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Offset {
    /// The other clock minus this one \[ns\].
    pub ahead_ns: i64,
    /// The truth is no farther away from that \[ns\].
    pub uncertainty_ns: i64,
}

impl RoundTrip {
    /// The offset is θ = ((T2 - T1) + (T3 - T4)) / 2, and the truth within half the time that the way took,
    /// δ = (T4 - T1) - (T3 - T2), whichever way was the slower one. None where a clock was set meanwhile, and of times
    /// that nobody can have measured.
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
    /// The same some time later: the clocks drift.
    fn aged(self, age_ms: u64) -> Self {
        let drift_ns = age_ms as f64 * 1e-3 * DRIFT_NS_PER_S;
        Self {
            uncertainty_ns: self.uncertainty_ns.saturating_add(drift_ns as i64),
            ..self
        }
    }

    /// Whether both can be true.
    fn agrees(self, other: Self) -> bool {
        let apart = self.ahead_ns.abs_diff(other.ahead_ns);
        let most = self.uncertainty_ns.saturating_add(other.uncertainty_ns);
        apart <= most.unsigned_abs()
    }

    /// Whether the clocks differ by more than `limit_ns` for certain.
    pub fn exceeds(self, limit_ns: i64) -> bool {
        let least = self.ahead_ns.saturating_abs();
        least.saturating_sub(self.uncertainty_ns) > limit_ns
    }
}

/// The newest measurements, of which the surest counts. A slow network makes a measurement uncertain, never wrong.
#[derive(Debug, Clone, Default)]
pub struct ClockFilter {
    /// Each with when it was made \[ms\].
    kept: VecDeque<(Offset, u64)>,
}

impl ClockFilter {
    /// Takes a measurement made at `now_ms` of a clock that only runs. One that cannot be true beside older ones tells
    /// that a clock was set: those are forgotten.
    pub fn note(&mut self, new: Offset, now_ms: u64) {
        self.kept
            .retain(|(old, at_ms)| old.aged(now_ms.saturating_sub(*at_ms)).agrees(new));
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back((new, now_ms));
    }

    /// The surest measurement, with what the clocks may have drifted since.
    pub fn best(&self, now_ms: u64) -> Option<Offset> {
        let aged = self.kept.iter();
        aged.map(|(offset, at_ms)| offset.aged(now_ms.saturating_sub(*at_ms)))
            .min_by_key(|offset| offset.uncertainty_ns)
    }

    /// How many measurements there are.
    pub fn len(&self) -> usize {
        self.kept.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// A clock that is `ahead` is asked at 0; the ways there and back, and what lies between them.
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
        // 15 us a second: after an hour the fast one is as uncertain as one of 55 ms.
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
