//! The clock of a recording: the stamps of its messages, or the time at which they were recorded.

use crate::finding::Finding;

/// Least number of messages for a judgement of the stamps.
/// Resolution: a fifth of a second at 100 Hz.
const LEAST_MESSAGES: usize = 20;
/// Stamps are coarse if this share of the messages has new values under the stamp of the message before.
/// Physical: two publishers of one clock tick share at most half of their stamps; a driver that repeats a message
/// repeats its values, too.
const COARSE_SHARE: f64 = 0.6;
/// Resolution of the stamps up to which the time of recording replaces them \[s\]. It includes delays of the network and
/// of the recorder, which coarser stamps cannot reveal.
/// Physical: a pause of this length is a gap for the filters of the twin.
const COARSEST_S: f64 = 0.25;
/// Distance of the ratio of two clocks from a power of 1000, in powers of ten, that still is that power.
/// Physical: the durations of one recording by two clocks differ by less than a quarter.
const NEAR: f64 = 0.1;
/// Powers of ten between s, ms, us and ns.
const UNITS: f64 = 3.0;

/// Source of the time of a message.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Clock {
    /// The stamp in its header, or the time at which it was received where the publisher leaves the stamp at zero.
    #[default]
    StampsOrReception,
    /// The stamp in its header.
    Stamps,
    /// The time at which it was recorded.
    Recording,
    /// The stamp in its header, divided by this number.
    Scaled(f64),
}

impl Clock {
    /// Time of a message \[ns\].
    pub fn time_ns(self, stamp_ns: i64, received_ns: i64) -> i64 {
        match self {
            Self::StampsOrReception if stamp_ns == 0 => received_ns,
            Self::StampsOrReception | Self::Stamps => stamp_ns,
            Self::Recording => received_ns,
            Self::Scaled(ratio) => (stamp_ns as f64 / ratio).round() as i64,
        }
    }
}

/// Stamp and log time of the first messages of a recording.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stamps {
    /// Stamp and log time \[ns\].
    pairs: Vec<(i64, i64)>,
    /// Messages with other values under the stamp of the message before.
    shared: usize,
}

impl Stamps {
    /// Takes a message; `is_new` says whether its values differ from those of the message before.
    pub fn add(&mut self, stamp_ns: i64, log_time_ns: i64, is_new: bool) {
        let before = self.pairs.last().map(|(stamp_ns, _)| *stamp_ns);
        self.shared += usize::from(is_new && before == Some(stamp_ns));
        self.pairs.push((stamp_ns, log_time_ns));
    }

    /// The clock to use, and what is wrong with the stamps if something is. `has_log_times` says whether the format
    /// has a time of recording besides the stamps.
    pub fn clock(&self, has_log_times: bool) -> (Clock, Option<Finding>) {
        let count = self.pairs.len();
        if count < LEAST_MESSAGES {
            return (Clock::Stamps, None);
        }
        let advance = |of: fn(&(i64, i64)) -> i64| -> f64 {
            let steps = self.pairs.windows(2);
            let steps = steps.map(|pair| (of(&pair[1]) - of(&pair[0])).max(0));
            steps.sum::<i64>() as f64
        };
        let (by_stamps, by_log) = (advance(|pair| pair.0), advance(|pair| pair.1));
        let has_log_times = has_log_times && by_log > 0.0;
        let first_ns = self.pairs[0].0;
        if self.pairs.iter().all(|(stamp_ns, _)| *stamp_ns == first_ns) {
            let finding = Finding::ConstantStamps {
                stamp_ns: first_ns,
                messages: count as u64,
                is_replaced: has_log_times,
            };
            let clock = if has_log_times {
                Clock::Recording
            } else {
                Clock::Stamps
            };
            return (clock, Some(finding));
        }
        if self.shared as f64 > COARSE_SHARE * count as f64 {
            return self.coarse(has_log_times);
        }
        let ratio = by_stamps / by_log.max(1.0);
        let units = (ratio.log10() / UNITS).round();
        if has_log_times && units != 0.0 && (ratio.log10() - UNITS * units).abs() < NEAR {
            let ratio = 10_f64.powf(UNITS * units);
            return (Clock::Scaled(ratio), Some(Finding::ScaledStamps { ratio }));
        }
        (Clock::Stamps, None)
    }

    fn coarse(&self, has_log_times: bool) -> (Clock, Option<Finding>) {
        let steps = self.pairs.windows(2).map(|pair| pair[1].0 - pair[0].0);
        let mut steps: Vec<i64> = steps.filter(|step_ns| *step_ns > 0).collect();
        steps.sort_unstable();
        let resolution_s = steps
            .get(steps.len() / 2)
            .map_or(0.0, |ns| *ns as f64 * 1e-9);
        let is_replaced = has_log_times && resolution_s <= COARSEST_S;
        let finding = Finding::CoarseStamps {
            resolution_s,
            messages_per_stamp: self.pairs.len() as f64 / (steps.len() + 1) as f64,
            has_log_times,
            is_replaced,
        };
        let clock = if is_replaced {
            Clock::Recording
        } else {
            Clock::Stamps
        };
        (clock, Some(finding))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const EPOCH_NS: i64 = 1_760_000_000_000_000_000;

    /// 500 messages at 100 Hz, each stamped by `stamp` of its true time.
    fn clock(stamp: impl Fn(i64) -> i64) -> (Clock, Option<Finding>) {
        let mut stamps = Stamps::default();
        for k in 0..500 {
            stamps.add(stamp(10 * MS * k), EPOCH_NS + 10 * MS * k, true);
        }
        stamps.clock(true)
    }

    #[test]
    fn stamps_of_the_epoch_of_simulated_time_and_of_a_loop_are_used_as_they_are() {
        assert_eq!(clock(|ns| EPOCH_NS + ns), (Clock::Stamps, None));
        assert_eq!(clock(|ns| ns), (Clock::Stamps, None));
        assert_eq!(clock(|ns| ns % (1000 * MS)), (Clock::Stamps, None));
    }

    #[test]
    fn the_time_of_recording_replaces_stamps_that_never_change_or_are_coarse() {
        for constant in [0, 5_000 * MS] {
            let (clock, finding) = clock(|_| constant);
            assert_eq!(clock, Clock::Recording);
            assert!(matches!(finding, Some(Finding::ConstantStamps { .. })));
        }
        let (clock, finding) = clock(|ns| ns / (50 * MS) * (50 * MS));
        assert_eq!(clock, Clock::Recording);
        let Some(Finding::CoarseStamps {
            resolution_s,
            messages_per_stamp,
            is_replaced: true,
            ..
        }) = finding
        else {
            panic!("{finding:?}")
        };
        assert!((resolution_s - 0.05).abs() < 1e-9 && (messages_per_stamp - 5.0).abs() < 0.1);
    }

    #[test]
    fn whole_seconds_are_refused() {
        let (_, finding) = clock(|ns| ns / (1000 * MS) * (1000 * MS));
        assert!(matches!(
            finding,
            Some(Finding::CoarseStamps {
                is_replaced: false,
                ..
            })
        ));
    }

    #[test]
    fn milliseconds_written_as_seconds_are_scaled() {
        let (clock, finding) = clock(|ns| 1000 * ns);
        assert_eq!(clock, Clock::Scaled(1000.0));
        assert_eq!(clock.time_ns(10_000 * MS, 0), 10 * MS);
        assert!(matches!(finding, Some(Finding::ScaledStamps { .. })));
    }
}
