//! Reconstruction of the drive's clock from the stamps of a recording.
//!
//! A drive samples on an even clock. The stamps are often assigned later, by a busy computer or in whole
//! milliseconds. A smoother that trusts them computes accelerations that did not occur. The positions show whether
//! the samples or only their stamps are uneven: the position of a sample that was taken late has advanced.

use super::Recording;

/// Smallest number of samples for an estimate of the clock.
/// Resolution: one second at 200 Hz.
const LEAST_SAMPLES: usize = 200;
/// Gain of the phase correction, relative to the deviation of a stamp.
/// Statistical: leaves √(0.05 / 1.95) = 16 % of the stamps' jitter; a smaller gain follows a wrong step too slowly.
const FOLLOWED: f64 = 0.05;
/// Largest RMS deviation of stamps that can be assigned to ticks, relative to the step.
/// Statistical: stamps uniform within a step have an RMS deviation of the root of a twelfth.
const MOST_OFF: f64 = 0.288;
/// RMS deviation from an even clock below which stamps are kept, relative to the step.
/// Resolution: far below what a smoother over many steps resolves.
const LEAST_OFF: f64 = 0.002;
/// Share of each stamp's deviation in the positions below which the samples were even.
/// Physical: half way between no deviation and all of it.
const SHOWN: f64 = 0.5;
/// Distance below that share at which the samples are accepted as even, in standard deviations.
/// Statistical: a normal variable exceeds it once in 740 recordings.
const SURE: f64 = 3.0;

/// An even clock on which the samples were placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EvenClock {
    /// Sampling period \[s\].
    pub step_s: f64,
    /// RMS deviation of the stamps \[s\].
    pub off_s: f64,
}

impl EvenClock {
    /// Returns the note for a report. `is_timed_by_log` states whether the time of recording replaces the stamps.
    pub fn note(&self, recording: &str, is_timed_by_log: bool) -> String {
        let times = if is_timed_by_log {
            "times of recording"
        } else {
            "stamps"
        };
        format!(
            "{recording}: its {times} differ by {:.2} ms (RMS) from an even clock of {:.3} ms. The positions are smoother over \
             that clock, so the samples are put on it.",
            1e3 * self.off_s,
            1e3 * self.step_s
        )
    }
}

impl Recording {
    /// Places the samples on the drive's even clock, if there is one and the positions show that they were taken on
    /// it.
    pub(super) fn put_on_even_clock(&mut self) {
        let Some((ticks, clock)) = ticks(&self.time_s) else {
            return;
        };
        if self.shows_less_than_half(&ticks, clock.step_s) {
            let first = ticks[0];
            self.time_s = (ticks.iter())
                .map(|tick| (tick - first) as f64 * clock.step_s)
                .collect();
            self.clock = Some(clock);
        }
    }

    /// Whether the positions contradict the stamps that are off the even clock. A sample taken later by δ than half
    /// way between its neighbours differs from their mean position by velocity times δ. The share of δ in the
    /// positions is estimated over all samples and joints, each joint weighted by its own noise.
    fn shows_less_than_half(&self, ticks: &[i64], step_s: f64) -> bool {
        let n = self.position.len() / self.len().max(1);
        let off: Vec<f64> = (ticks.iter().zip(&self.time_s))
            .map(|(tick, time)| time - (tick - ticks[0]) as f64 * step_s)
            .collect();
        let inner: Vec<usize> = (1..self.len() - 1)
            .filter(|&k| ticks[k + 1] - ticks[k] == 1 && ticks[k] - ticks[k - 1] == 1)
            .collect();
        let (mut seen, mut possible) = (0.0, 0.0);
        for j in 0..n {
            let at = |k: usize| self.position[k * n + j];
            let beside = |k: usize| at(k) - 0.5 * (at(k - 1) + at(k + 1));
            let expected = |k: usize| {
                let velocity = (at(k + 1) - at(k - 1)) / (2.0 * step_s);
                velocity * (off[k] - 0.5 * (off[k - 1] + off[k + 1]))
            };
            let (mut both, mut square, mut variance) = (0.0, 0.0, 0.0);
            for &k in &inner {
                let (beside, expected) = (beside(k), expected(k));
                both += beside * expected;
                square += expected * expected;
                variance += beside * beside;
            }
            variance /= inner.len().max(1) as f64;
            if variance > 0.0 {
                seen += both / variance;
                possible += square / variance;
            }
        }
        possible > 0.0 && seen / possible + SURE / possible.sqrt() < SHOWN
    }
}

/// Assigns each stamp to a tick of an even clock, if the stamps fit one.
fn ticks(time_s: &[f64]) -> Option<(Vec<i64>, EvenClock)> {
    if time_s.len() < LEAST_SAMPLES {
        return None;
    }
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let (_, step, _) = steps.select_nth_unstable_by(time_s.len() / 2 - 1, f64::total_cmp);
    let step = *step;
    let (mut tick, mut phase) = (0_i64, time_s[0]);
    let mut ticks = vec![0];
    for time in &time_s[1..] {
        let passed = ((time - phase) / step).round();
        // The stamp before was late by more than half a step, so rounding gave it the tick of this sample.
        if passed < 1.0
            && let [.., before, last] = ticks[..]
            && last - before > 1
        {
            let at = ticks.len() - 1;
            ticks[at] -= 1;
            tick -= 1;
            phase -= step;
        }
        let passed = ((time - phase) / step).round().max(1.0);
        tick += passed as i64;
        phase += passed * step;
        phase += FOLLOWED * (time - phase);
        ticks.push(tick);
    }
    let (start_s, step_s) = line(&ticks, time_s);
    let off = |(tick, time): (&i64, &f64)| time - start_s - *tick as f64 * step_s;
    let off: Vec<f64> = ticks.iter().zip(time_s).map(off).collect();
    let off_s = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    let is_clock = off_s < MOST_OFF * step_s && off_s > LEAST_OFF * step_s;
    is_clock.then_some((ticks, EvenClock { step_s, off_s }))
}

/// Fits a straight line to the stamps over their ticks; returns its intercept and slope.
fn line(ticks: &[i64], time_s: &[f64]) -> (f64, f64) {
    let count = ticks.len() as f64;
    let mean_tick = ticks.iter().map(|tick| *tick as f64).sum::<f64>() / count;
    let mean_time = time_s.iter().sum::<f64>() / count;
    let (mut both, mut square) = (0.0, 0.0);
    for (tick, time) in ticks.iter().zip(time_s) {
        let tick = *tick as f64 - mean_tick;
        both += tick * (time - mean_time);
        square += tick * tick;
    }
    let step_s = both / square;
    (mean_time - step_s * mean_tick, step_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, recording};

    /// Simulates a recording with a step of 3 ms. `taken` and `stamped` are the deviations of sampling times and
    /// stamps from the even clock, relative to the step.
    fn sampled(taken: impl Fn(usize) -> f64, stamped: impl Fn(usize) -> f64) -> Recording {
        let mut it = recording(&model(), 3, |_, _, _| {});
        let n = it.position.len() / it.len();
        let step = 0.003;
        let count = 2000;
        it.time_s = (0..count).map(|k| step * (k as f64 + stamped(k))).collect();
        it.position = (0..count)
            .flat_map(|k| {
                let at = step * (k as f64 + taken(k));
                (0..n).map(move |j| 0.4 * (2.0 * at + j as f64).sin())
            })
            .collect();
        it
    }

    fn jitter() -> Vec<f64> {
        let mut noise = Noise(5);
        (0..2000)
            .map(|_| (0.1 * noise.next()).clamp(-0.3, 0.3))
            .collect()
    }

    #[test]
    fn late_stamps_of_even_samples_are_put_back() {
        let late = jitter();
        let mut it = sampled(|_| 0.0, |k| late[k]);
        it.put_on_even_clock();
        let clock = it.clock.unwrap();
        assert!((clock.step_s - 0.003).abs() < 1e-7, "{clock:?}");
        let steps = it.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(steps.clone().all(|step| (step - 0.003).abs() < 1e-6));
    }

    /// Some of two thousand stamps are late by more than half a step, and appear to belong to the next tick.
    #[test]
    fn stamps_that_are_late_by_more_than_half_a_step_are_put_back() {
        let mut noise = Noise(8);
        let late: Vec<f64> = (0..2000).map(|_| 0.17 * noise.next()).collect();
        assert!(late.iter().any(|late| *late > 0.5));
        let mut it = sampled(|_| 0.0, |k| late[k]);
        it.time_s.sort_by(f64::total_cmp);
        it.put_on_even_clock();
        let steps = it.time_s.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(it.clock.is_some());
        assert!(steps.clone().all(|step| (step - 0.003).abs() < 1e-5));
    }

    #[test]
    fn samples_that_were_taken_when_they_are_stamped_stay() {
        let late = jitter();
        let mut it = sampled(|k| late[k], |k| late[k]);
        let before = it.time_s.clone();
        it.put_on_even_clock();
        assert!(it.clock.is_none());
        assert_eq!(it.time_s, before);
    }

    #[test]
    fn stamps_in_whole_milliseconds_are_put_back_with_their_gaps() {
        let mut it = sampled(|_| 0.0, |_| 0.0);
        let n = it.position.len() / it.len();
        // The step is 3.003 ms instead of 3 ms, so a stamp in whole milliseconds falls behind now and then.
        let kept: Vec<usize> = (0..2000).filter(|k| k % 97 > 8).collect();
        it.position = kept
            .iter()
            .flat_map(|&k| it.position[k * n..(k + 1) * n].to_vec())
            .collect();
        let whole_ms = |k: &usize| (3.003 * *k as f64).floor() * 1e-3;
        it.time_s = kept
            .iter()
            .map(|k| whole_ms(k) - whole_ms(&kept[0]))
            .collect();
        it.put_on_even_clock();
        let clock = it.clock.unwrap();
        assert!((clock.step_s - 0.003_003).abs() < 1e-7, "{clock:?}");
        let ticks: Vec<i64> = it
            .time_s
            .iter()
            .map(|t| (t / clock.step_s).round() as i64)
            .collect();
        assert!(
            ticks
                .iter()
                .zip(&kept)
                .all(|(tick, k)| *tick == (*k - kept[0]) as i64)
        );
    }

    #[test]
    fn an_even_clock_and_an_arm_at_rest_stay_as_they_are() {
        let mut even = sampled(|_| 0.0, |_| 0.0);
        even.put_on_even_clock();
        assert!(even.clock.is_none());
        let late = jitter();
        let mut still = sampled(|_| 0.0, |k| late[k]);
        still.position.fill(0.1);
        still.put_on_even_clock();
        assert!(still.clock.is_none());
    }
}
