//! Checks whether a stream has the sample rate of the training data.

use tauscope_bus::{TwinState, flags};

use super::lesson::Lesson;
use super::setup::Setup;

/// Number of steps whose median is a stream's period.
/// Statistical: odd, so that the median is one of them, and enough that a few late ones do not move it.
const COUNT: usize = 101;
/// Duration after which the median is taken from fewer steps, as a multiple of [`COUNT`] steps at the training rate.
/// Statistical: a stream that slow has another rate, whatever its median.
const PATIENCE: f64 = 3.0;
/// Minimum number of steps for a median.
/// Statistical: two late ones among them do not move it.
const LEAST: usize = 5;
/// Number of wrong medians, without a right one before, after which the stream is faulty and not temporarily slow.
/// Chosen: a publisher may take five medians to start, up to 15 s at 100 Hz. Fewer end the run of a slow start, more
/// delay the message about a stream of another rate.
const NEVER: u32 = 5;
/// Relative difference up to which two rates are treated as equal.
/// Chosen: the noise of a mean, proportional to 1/√rate, then differs by at most 12 %. A smaller tolerance rejects a
/// publisher with an inexact timer, a larger one makes the learnt noise wrong.
const SAME: f64 = 0.2;
/// Minimum interval between warnings about a fluctuating rate \[ns\].
/// Resolution: what a person reads.
const TOLD_EVERY_NS: i64 = 10_000_000_000;

/// Compares the rate of a stream with the rate at which a detector was trained or tuned: windows, recurrent
/// networks and the noise of short means are valid for no other rate. No allocation per sample.
///
/// The rate is checked continuously, because a publisher may be slow for a while. During that time the detector
/// cannot judge.
#[derive(Debug, Clone)]
pub(crate) struct Rate {
    /// The detector and its cell, for the warnings.
    who: String,
    learnt_hz: f64,
    before_ns: Option<i64>,
    periods_ns: [i64; COUNT],
    count: usize,
    /// Sum of the periods \[ns\].
    lasts_ns: i64,
    /// The newest median.
    found_hz: Option<f64>,
    /// Whether any median was right.
    was_right: bool,
    /// Number of wrong medians before the first right one.
    wrong: u32,
    /// Stamp of the last warning \[ns\].
    told_ns: Option<i64>,
}

impl Rate {
    /// Creates the check for the detector `name` of the cell in `setup`, trained at `learnt_hz`.
    pub fn new(name: &str, setup: &Setup, learnt_hz: f64) -> Self {
        let cell = match setup.cell.as_str() {
            "" => String::new(),
            cell => format!(" of cell `{cell}`"),
        };
        Self {
            who: format!("detector `{name}`{cell}"),
            learnt_hz,
            before_ns: None,
            periods_ns: [0; COUNT],
            count: 0,
            lasts_ns: 0,
            found_hz: None,
            was_right: false,
            wrong: 0,
            told_ns: None,
        }
    }

    /// Adds the next sample. A median needs several steps; [`flags::RESET`] discards those so far. A repeated stamp
    /// is not a step.
    #[inline]
    pub fn update(&mut self, sample: &TwinState) {
        if sample.header.has(flags::RESET) {
            self.before_ns = None;
            (self.count, self.lasts_ns) = (0, 0);
        }
        let stamp_ns = sample.header.stamp_ns;
        if let Some(before_ns) = self.before_ns.replace(stamp_ns)
            && stamp_ns > before_ns
        {
            self.periods_ns[self.count] = stamp_ns - before_ns;
            self.count += 1;
            self.lasts_ns += stamp_ns - before_ns;
            let is_slow = self.count >= LEAST
                && self.lasts_ns as f64 * 1e-9 * self.learnt_hz > PATIENCE * COUNT as f64;
            let is_first = self.found_hz.is_none() && self.count == LEAST;
            if self.count == COUNT || is_slow || is_first {
                self.look(stamp_ns);
            }
        }
    }

    /// Computes the median of the collected steps, and warns if the rate became right or wrong.
    fn look(&mut self, now_ns: i64) {
        let was_right = self.found_hz.is_none() || self.is_right();
        let found_hz = 1e9 / median(&mut self.periods_ns[..self.count]);
        (self.count, self.lasts_ns) = (0, 0);
        self.found_hz = Some(found_hz);
        let is_right = self.is_right();
        self.was_right |= is_right;
        self.wrong += u32::from(!self.was_right);
        let told_lately = (self.told_ns).is_some_and(|told_ns| now_ns - told_ns < TOLD_EVERY_NS);
        if is_right == was_right || told_lately {
            return;
        }
        self.told_ns = Some(now_ns);
        tracing::warn!("{}", self.told(found_hz));
    }

    /// Returns the warning for a rate that has changed to `found_hz`.
    fn told(&self, found_hz: f64) -> String {
        let (who, learnt_hz) = (&self.who, self.learnt_hz);
        if same(learnt_hz, found_hz) {
            return format!("{who} judges again: {found_hz:.1} samples a second");
        }
        format!(
            "{who} cannot judge: it has learnt from {learnt_hz:.1} samples a second, and here are {found_hz:.1}"
        )
    }

    /// Returns whether the stream has the rate; false until the first median.
    pub fn is_right(&self) -> bool {
        self.found_hz
            .is_some_and(|found| same(self.learnt_hz, found))
    }

    /// Returns a message if the stream never had the rate, once that is certain.
    pub fn fault(&self) -> Option<String> {
        let (learnt, found) = (self.learnt_hz, self.found_hz?);
        (!self.was_right && self.wrong >= NEVER).then(|| {
            format!(
                "it has learnt from {learnt:.1} samples a second, and here are {found:.1}: let `tauscope init` or `tauscope evaluate` learn from recordings of this rate"
            )
        })
    }
}

/// Returns the sample rate of recordings \[Hz\], from the median of their steps; `None` without two different stamps.
pub(crate) fn of(lessons: &[&[Lesson]]) -> Option<f64> {
    let samples = lessons.iter().flat_map(|lessons| lessons.iter());
    let mut periods_ns: Vec<i64> = samples
        .flat_map(|lesson| lesson.samples.windows(2))
        .map(|pair| pair[1].header.stamp_ns - pair[0].header.stamp_ns)
        .filter(|period_ns| *period_ns > 0)
        .collect();
    // Three decimals survive writing to and reading from any file format.
    let hz = |period_ns: f64| (1e12 / period_ns).round() / 1e3;
    (!periods_ns.is_empty()).then(|| hz(median(&mut periods_ns)))
}

/// Returns whether two rates are equal within the tolerance for clocks.
pub(crate) fn same(learnt_hz: f64, found_hz: f64) -> bool {
    (found_hz / learnt_hz - 1.0).abs() <= SAME
}

fn median(periods_ns: &mut [i64]) -> f64 {
    let middle = periods_ns.len() / 2;
    *periods_ns.select_nth_unstable(middle).1 as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds one second of samples at `hz`, from `stamp_ns` on. Returns the stamp after them.
    fn second(rate: &mut Rate, stamp_ns: i64, hz: i64) -> i64 {
        let step_ns = 1_000_000_000 / hz;
        for n in 0..hz {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = stamp_ns + n * step_ns;
            rate.update(&sample);
        }
        stamp_ns + 1_000_000_000
    }

    fn rate(learnt_hz: f64) -> Rate {
        Rate::new("tauscope", &Setup::default(), learnt_hz)
    }

    #[test]
    fn a_warning_names_the_detector_and_its_cell() {
        let setup = Setup {
            cell: "press_3".to_owned(),
            ..Setup::default()
        };
        let rate = Rate::new("window_ocsvm", &setup, 500.0);
        let who = "detector `window_ocsvm` of cell `press_3`";
        let cannot = "cannot judge: it has learnt from 500.0 samples a second, and here are 100.0";
        assert_eq!(rate.told(100.0), format!("{who} {cannot}"));
        let again = "judges again: 499.0 samples a second";
        assert_eq!(rate.told(499.0), format!("{who} {again}"));
    }

    #[test]
    fn a_slow_spell_is_waited_through() {
        let mut rate = rate(500.0);
        let mut now_ns = second(&mut rate, 0, 500);
        assert!(rate.is_right());
        for hz in [250, 5, 5, 5] {
            now_ns = second(&mut rate, now_ns, hz);
            assert!(!rate.is_right(), "{hz}");
        }
        now_ns = second(&mut rate, now_ns, 500);
        second(&mut rate, now_ns, 500);
        assert!(rate.is_right());
        assert_eq!(rate.fault(), None);
    }

    #[test]
    fn nothing_is_judged_before_the_rate_is_known() {
        let mut rate = rate(500.0);
        for n in 0..3_i64 {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = n * 200_000_000;
            rate.update(&sample);
            assert!(!rate.is_right(), "{n}");
        }
    }

    #[test]
    fn a_stream_that_never_has_the_rate_is_a_fault() {
        let mut rate = rate(100.0);
        let mut now_ns = 0;
        for _ in 0..2 {
            now_ns = second(&mut rate, now_ns, 200);
            assert_eq!((rate.is_right(), rate.fault()), (false, None));
        }
        second(&mut rate, now_ns, 200);
        assert!(rate.fault().is_some());
    }
}
