//! Whether a stream comes at the rate that something was learnt at.

use tauscope_bus::{TwinState, flags};

use super::lesson::Lesson;

/// Steps whose median is a stream's period.
/// Statistical: odd, so that the median is one of them, and enough that a few late ones do not move it.
const COUNT: usize = 101;
/// Rates that differ by no more than this share are one.
/// Tuned: by hand, on no recorded seeds; not swept.
const SAME: f64 = 0.2;

/// Holds the rate of a stream against the one that a detector was trained or tuned at: windows, recurrent
/// nets and the noise of short means hold for no other. No allocation per sample.
#[derive(Debug, Clone)]
pub(crate) struct Rate {
    learnt_hz: f64,
    before_ns: Option<i64>,
    periods_ns: [i64; COUNT],
    count: usize,
    found_hz: Option<f64>,
}

impl Rate {
    /// For what was learnt at `learnt_hz`.
    pub fn new(learnt_hz: f64) -> Self {
        Self {
            learnt_hz,
            before_ns: None,
            periods_ns: [0; COUNT],
            count: 0,
            found_hz: None,
        }
    }

    /// Takes the next sample. The median of its steps is known after some, and asked for anew after a
    /// [`flags::RESET`]; repeated stamps are no steps.
    #[inline]
    pub fn update(&mut self, sample: &TwinState) {
        if sample.header.has(flags::RESET) {
            self.before_ns = None;
            self.count = 0;
        }
        if self.count == COUNT {
            return;
        }
        let stamp_ns = sample.header.stamp_ns;
        if let Some(before_ns) = self.before_ns.replace(stamp_ns)
            && stamp_ns > before_ns
        {
            self.periods_ns[self.count] = stamp_ns - before_ns;
            self.count += 1;
            if self.count == COUNT {
                self.found_hz = Some(1e9 / median(&mut self.periods_ns));
            }
        }
    }

    /// What is wrong with the rate, once it is known.
    pub fn fault(&self) -> Option<String> {
        let (learnt, found) = (self.learnt_hz, self.found_hz?);
        (!same(learnt, found)).then(|| {
            format!(
                "it has learnt from {learnt:.1} samples a second, and here are {found:.1}: let `tauscope evaluate` train it on recordings of this rate"
            )
        })
    }
}

/// Samples a second of recordings, from the median of their steps; `None` where there are no two stamps.
pub(crate) fn of(lessons: &[&[Lesson]]) -> Option<f64> {
    let samples = lessons.iter().flat_map(|lessons| lessons.iter());
    let mut periods_ns: Vec<i64> = samples
        .flat_map(|lesson| lesson.samples.windows(2))
        .map(|pair| pair[1].header.stamp_ns - pair[0].header.stamp_ns)
        .filter(|period_ns| *period_ns > 0)
        .collect();
    // Three decimals, which every reader gives back unchanged.
    let hz = |period_ns: f64| (1e12 / period_ns).round() / 1e3;
    (!periods_ns.is_empty()).then(|| hz(median(&mut periods_ns)))
}

/// Whether two rates are one, for all that clocks do.
pub(crate) fn same(learnt_hz: f64, found_hz: f64) -> bool {
    (found_hz / learnt_hz - 1.0).abs() <= SAME
}

fn median(periods_ns: &mut [i64]) -> f64 {
    let middle = periods_ns.len() / 2;
    *periods_ns.select_nth_unstable(middle).1 as f64
}
