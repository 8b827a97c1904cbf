//! Selection of the samples of a recording that a joint is fitted to: those whose motion is known.

use tauscope_dynamics::terms::STANDSTILL_RAD_S;

use crate::data::track::Track;
use crate::read::recording::{MAX_GAP_S, mean_step_s};

/// Margin at the ends of the recording and at gaps within which samples are excluded, in periods of the cutoff.
/// Derived: the boundary error of the motion's smoother, with half amplitude at f = 2 cutoffs, decays as exp(-π f t):
/// to 1 % within 0.73 periods, rounded up.
const END_PERIODS: f64 = 0.8;
/// Margin at standstills and reversals of the joint within which samples are excluded, in periods of the cutoff. The
/// motion does not determine the friction there.
/// Tuned: by hand, on no recorded seeds; not swept.
const REVERSAL_PERIODS: f64 = 0.4;
/// Length of a gap that leaves the acceleration undetermined, in periods of the cutoff.
/// Physical: a motion below the cutoff bends within a quarter of its period.
const OPEN_PERIODS: f64 = 0.3;
/// Smallest length of such a gap, in mean sample intervals.
/// Resolution: on an uneven clock two or three samples in a row are missing now and then.
const OPEN_SAMPLES: f64 = 4.0;

impl Track {
    /// Returns the start and end of each gap that leaves the motion below a cutoff undetermined, with its margins
    /// \[s\].
    pub(crate) fn gaps(&self, cutoff_hz: f64) -> Vec<[f64; 2]> {
        // Poses need no motion.
        if mean_step_s(&self.time_s) > MAX_GAP_S {
            return Vec::new();
        }
        let open = (OPEN_PERIODS / cutoff_hz).max(OPEN_SAMPLES * mean_step_s(&self.time_s));
        let pairs = self.time_s.windows(2);
        let beside = |pair: &[f64]| {
            let periods = match pair[1] - pair[0] {
                step if step > MAX_GAP_S => END_PERIODS,
                step if step > open => REVERSAL_PERIODS,
                _ => return None,
            };
            let margin = periods / cutoff_hz;
            Some([pair[0] - margin, pair[1] + margin])
        };
        pairs.filter_map(beside).collect()
    }

    /// Selects the samples of a joint that are compared: all but the ends, the `gaps` and, if the joint `moves`, its
    /// standstills and reversals.
    pub(crate) fn counts(
        &self,
        joint: usize,
        moves: bool,
        gaps: &[[f64; 2]],
        cutoff_hz: f64,
    ) -> Vec<bool> {
        let n = self.position.len() / self.len();
        let time = &self.time_s;
        let mut counts = vec![true; time.len()];
        let mut spoil = |from: f64, to: f64| {
            let first = time.partition_point(|t| *t < from);
            let last = time.partition_point(|t| *t <= to);
            counts[first..last].fill(false);
        };
        let margin = END_PERIODS / cutoff_hz;
        let (start, end) = (time[0], time[time.len() - 1]);
        spoil(start, start + margin);
        spoil(end - margin, end);
        for &[from, to] in gaps {
            spoil(from, to);
        }
        if moves {
            let margin = REVERSAL_PERIODS / cutoff_hz;
            let velocity = |k: usize| self.velocity[k * n + joint];
            for (k, &t) in time.iter().enumerate() {
                let reverses = k > 0 && velocity(k) * velocity(k - 1) < 0.0;
                if reverses || velocity(k).abs() < STANDSTILL_RAD_S {
                    spoil(t - margin, t + margin);
                }
            }
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use crate::data::problem::Problem;
    use crate::fixture;
    use crate::read::recording::MAX_GAP_S;

    /// Returns the number of compared rows of a joint if `gap_s` of the recording are missing from 3 s on.
    fn rows_that_count(gap_s: f64) -> usize {
        let model = fixture::model();
        let mut recording = fixture::recording(&model, 4, |_, _, _| {});
        let lost = |t: f64| t > 3.0 && t < 3.0 + gap_s;
        let kept: Vec<bool> = recording.time_s.iter().map(|t| !lost(*t)).collect();
        for rows in [
            &mut recording.position,
            &mut recording.velocity,
            &mut recording.effort,
        ] {
            let all = std::mem::take(rows);
            let rows_of = all.chunks_exact(2).zip(&kept).filter(|(_, kept)| **kept);
            rows.extend(rows_of.flat_map(|(row, _)| row.iter().copied()));
        }
        recording.time_s.retain(|t| !lost(*t));
        let problem: Problem = fixture::problem(&model, &[recording]);
        problem.weight[problem.joint_rows(0)]
            .iter()
            .filter(|weight| **weight > 0.0)
            .count()
    }

    #[test]
    fn a_gap_that_leaves_the_acceleration_open_does_not_count_and_neither_does_what_is_beside_it() {
        let all = rows_that_count(0.0);
        assert_eq!(rows_that_count(0.02), all);
        let short = rows_that_count(0.07);
        assert!(short < all, "{short} of {all}");
        assert!(rows_that_count(1.2 * MAX_GAP_S) < short);
    }
}
