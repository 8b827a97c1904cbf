//! Effort that is late by an amount that varies, the same for all joints: a recorder or a bus that is busy now and then.
//!
//! A delay d adds -d times the effort's rate of change to each joint. So over a short while one number d must fit the
//! remainders of all joints at once.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

/// For so many rows in turn the delay is taken as constant.
/// Resolution: a few tenths of a second at the comparison's spacing of 0.06 s.
const ROWS: usize = 5;
/// Share of the squares of all joints, in units of what each leaves, that the delay must take.
/// Statistical: one number among five rows of three joints or more takes 7 % of noise.
const LEAST_SHARE: f64 = 0.4;
/// Joints that must show it, each by this share of its own squares.
/// Statistical: in fewer it may be a law of the joint.
const LEAST_JOINTS: usize = 3;
/// See [`LEAST_JOINTS`].
const LEAST_OF_JOINT: f64 = 0.3;
/// A delay that varies by less is how stamps are made \[s\], or so many samples.
/// Resolution: delays below this are not searched for.
const LEAST_S: f64 = 0.002;
/// See [`LEAST_S`].
const LEAST_SAMPLES: f64 = 0.5;

/// A delay that varies.
#[derive(Debug, Clone, PartialEq)]
pub struct VaryingDelay {
    /// Its RMS about its mean \[s\].
    pub rms_s: f64,
    /// Joints that show it.
    pub joints: Vec<usize>,
}

/// The delay that varies in what `fit` leaves, if one does. `rate` gives the rate of change of the twin's effort at a joint
/// \[N m/s\], a number for each row of the problem.
pub fn varying_delay(problem: &Problem, fit: &Fit, rates: &[Vec<f64>]) -> Option<VaryingDelay> {
    shown_by(LEAST_JOINTS, problem, fit, rates)
}

/// The same, if so many joints show it.
fn shown_by(
    least_joints: usize,
    problem: &Problem,
    fit: &Fit,
    rates: &[Vec<f64>],
) -> Option<VaryingDelay> {
    let joints = problem.joints;
    let (mut own_left, mut own_taken) = (vec![0.0; joints], vec![0.0; joints]);
    let (mut squares, mut count) = (0.0, 0.0_f64);
    for track in &problem.tracks {
        let rows: Vec<usize> = track.rows().collect();
        for some in rows.chunks(ROWS) {
            let each = || {
                (0..joints).flat_map(|j| {
                    let at = move |row: &usize| (j, problem.joint_rows(j).start + row, *row);
                    some.iter().map(at)
                })
            };
            let counted = |&(_, at, _): &(usize, usize, usize)| problem.weight[at] > 0.0;
            let (mut product, mut square) = (0.0, 0.0);
            for (j, at, row) in each().filter(counted) {
                let scale = 1.0 / fit.variance[j].max(f64::MIN_POSITIVE);
                product += scale * fit.residual[at] * rates[j][row];
                square += scale * rates[j][row] * rates[j][row];
            }
            if square <= 0.0 {
                continue;
            }
            let delay_s = -product / square;
            for (j, at, row) in each().filter(counted) {
                let residual = fit.residual[at];
                let less = residual + delay_s * rates[j][row];
                own_left[j] += residual * residual;
                own_taken[j] += residual * residual - less * less;
            }
            squares += delay_s * delay_s * square;
            count += square;
        }
    }
    let share = |j: usize| own_taken[j] / own_left[j].max(f64::MIN_POSITIVE);
    let shows: Vec<usize> = (0..joints).filter(|&j| share(j) > LEAST_OF_JOINT).collect();
    let all: f64 = (0..joints).map(share).sum::<f64>() / joints.max(1) as f64;
    let rms_s = (squares / count.max(f64::MIN_POSITIVE)).sqrt();
    let time = &problem.tracks.first()?.track.time_s;
    let sample_s = time.last()? / (time.len().saturating_sub(1).max(1)) as f64;
    let is_told = shows.len() >= least_joints
        && all > LEAST_SHARE
        && rms_s > LEAST_S.max(LEAST_SAMPLES * sample_s);
    is_told.then_some(VaryingDelay {
        rms_s,
        joints: shows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::fixture::{Noise, model, problem, recording};

    fn rates(problem: &Problem) -> Vec<Vec<f64>> {
        crate::report::remainder::rates(problem, &Fit::new(problem, Vec::new()))
    }

    /// What is told of two recordings whose efforts are late by what `late_s` gives for a sample, or have slow noise where
    /// it gives nothing.
    fn told(late_s: impl Fn(usize) -> Option<f64>) -> Option<VaryingDelay> {
        let model = model();
        let mut noise = Noise(3);
        let recordings = [1, 2].map(|seed| {
            let (mut k, mut before, mut slow) = (0, [0.0; 2], [0.0; 2]);
            recording(&model, seed, |_, _, effort| {
                for j in 0..2 {
                    let change = if k == 0 { 0.0 } else { effort[j] - before[j] };
                    before[j] = effort[j];
                    slow[j] = 0.98 * slow[j] + 0.2 * noise.next();
                    // 100 samples a second.
                    effort[j] += late_s(k).map_or(slow[j], |late_s| -late_s * change / 0.01);
                }
                k += 1;
            })
        });
        let problem = problem(&model, &recordings);
        let nothing = Fit::new(&problem, Vec::new());
        shown_by(2, &problem, &nothing, &rates(&problem))
    }

    #[test]
    fn a_delay_that_comes_and_goes_is_told_with_its_size() {
        let told = told(|k| Some(if k / 100 % 2 == 0 { 0.02 } else { -0.02 }));
        let told = told.expect("both joints show it");
        assert_eq!(told.joints, [0, 1]);
        assert!((0.01..0.03).contains(&told.rms_s), "{}", told.rms_s);
    }

    #[test]
    fn slow_noise_of_each_joint_is_no_delay() {
        assert_eq!(told(|_| None), None);
    }
}
