//! Comparison of measured and computed efforts: whether they are those of one robot.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::STANDSTILL_RAD_S;

use crate::data::problem::Problem;

/// Smallest standard deviation of the twin's effort at a compared joint, in standard deviations of the noise.
/// Chosen: noise alone then leaves 1 / 25 of the variance unexplained, less than half of `remedies::SUSPECT`.
pub(super) const STRONG: f64 = 5.0;
/// Smallest share of the variance after friction that the scaled effort of the twin explains at a matching joint.
/// Tuned: by hand, on no recorded seeds; not swept.
const FOLLOWS: f64 = 0.15;
/// Smallest number of rows of a compared joint.
/// Statistical: five rows for each of four coefficients.
pub(super) const LEAST_ROWS: usize = 20;
/// Ridge added to the diagonal of the normal equations, relative to their trace.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// Agreement of measured efforts with those that the motion requires.
#[derive(Debug, Clone)]
pub struct Likeness {
    /// Number of joints whose required effort exceeds the noise.
    strong: usize,
    /// Measured over required effort by joint that follows the motion.
    pub slopes: Vec<(usize, f64)>,
}

impl Likeness {
    /// Compares all joints.
    pub fn of(problem: &Problem) -> Self {
        let (mut strong, mut slopes) = (0, Vec::new());
        for joint in 0..problem.joints {
            let (share, slope, spread) = regression(problem, joint);
            if spread < STRONG * problem.white_noise[joint] {
                continue;
            }
            strong += 1;
            if share > FOLLOWS && slope > 0.0 {
                slopes.push((joint, slope));
            }
        }
        Self { strong, slopes }
    }

    /// Returns the reason against a verdict if these efforts are not this robot's.
    pub fn of_another_robot(&self) -> Option<String> {
        let Self { strong, slopes } = self;
        let following = slopes.len();
        let another = 2 * following < *strong || (*strong >= 2 && following == 0);
        another.then(|| {
            format!(
                "the effort of {} of {strong} joints does not follow the effort that this robot's motion requires: the \
                 recording is of another robot, joints have other signs, or gravity is subtracted from the effort",
                strong - following
            )
        })
    }
}

/// Returns the share of a joint's measured variance after friction that the twin's effort explains, the slope, and
/// the standard deviation of the twin's effort \[N m\].
fn regression(problem: &Problem, joint: usize) -> (f64, f64, f64) {
    let rows = problem.joint_rows(joint);
    let n = problem.joints;
    let rigid: Vec<Vec<f64>> = problem
        .tracks
        .iter()
        .map(|t| t.track.rigid.clone())
        .collect();
    let mut model = vec![0.0; problem.rows];
    problem.joint_signal(&rigid, joint, &mut model);
    let (mut xs, mut ys) = (Vec::new(), Vec::new());
    for track in &problem.tracks {
        for (row, &k) in track.rows().zip(&track.compared) {
            if problem.weight[rows.start + row] > 0.0 {
                let velocity = track.track.velocity[k * n + joint];
                let sign = if velocity.abs() < STANDSTILL_RAD_S {
                    0.0
                } else {
                    velocity.signum()
                };
                xs.push([1.0, sign, velocity, model[row]]);
                ys.push(problem.measured[rows.start + row]);
            }
        }
    }
    let m = ys.len();
    if m < LEAST_ROWS {
        return (1.0, 1.0, 0.0);
    }
    let mean = xs.iter().map(|x| x[3]).sum::<f64>() / m as f64;
    let spread = (xs.iter().map(|x| (x[3] - mean).powi(2)).sum::<f64>() / m as f64).sqrt();
    let y = DVector::from_vec(ys);
    let left = |columns: usize| {
        let x = DMatrix::from_fn(m, columns, |a, b| xs[a][b]);
        let mut normal = x.transpose() * &x;
        for a in 0..columns {
            normal[(a, a)] += RIDGE * normal.trace() + 1e-12;
        }
        let solution = normal.cholesky().map(|c| c.solve(&(x.transpose() * &y)));
        let solution = solution.unwrap_or_else(|| DVector::zeros(columns));
        ((&y - &x * &solution).norm_squared(), solution[columns - 1])
    };
    let (without, _) = left(3);
    let (with, slope) = left(4);
    (1.0 - with / without.max(1e-300), slope, spread)
}
