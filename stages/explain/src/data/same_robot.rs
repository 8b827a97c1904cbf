//! Whether measured and computed efforts are those of one robot, in one unit.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::effort_scale::{EffortScale, Slope};

use crate::data::problem::Problem;
use crate::read::audit::MOVES;
use crate::read::input::Input;

/// A joint is compared if the standard deviation of its twin's effort is at least this many times the noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const STRONG: f64 = 5.0;
/// A joint follows the twin if the scaled effort explains at least this share of the variance that friction leaves.
/// Tuned: by hand, on no recorded seeds; not swept.
const FOLLOWS: f64 = 0.15;
/// A joint with fewer rows than this is not compared.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_ROWS: usize = 20;
/// Added to the diagonal of the normal equations, as a share of their trace.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// The reason why these efforts allow no verdict, if there is one: a wrong robot or a wrong unit.
pub fn reason_against(input: &Input, problem: &Problem) -> Option<String> {
    if !input.bodies || input.start.is_some() {
        return None;
    }
    let (mut strong, mut following, mut slopes) = (0, 0, Vec::new());
    for j in 0..problem.joints {
        let (share, slope, spread) = regression(problem, j);
        if spread < STRONG * problem.white_noise[j] {
            continue;
        }
        strong += 1;
        if share > FOLLOWS && slope > 0.0 {
            following += 1;
            let joint = input
                .model
                .joint_names()
                .nth(j)
                .unwrap_or_default()
                .to_owned();
            slopes.push(Slope { joint, slope });
        }
    }
    if strong == 0 {
        return None;
    }
    if 2 * following < strong || (strong >= 2 && following == 0) {
        return Some(format!(
            "the effort of {} of {strong} joints does not follow the effort that this robot's motion requires: the \
             recording is of another robot, joints have other signs, or gravity is subtracted from the effort",
            strong - following
        ));
    }
    let known_scale = input.effort_unit == "Nm" || input.torque_constants_nm_per_a.is_some();
    let fault = EffortScale::of(&slopes)
        .fault_in_nm()
        .filter(|_| known_scale);
    fault.map(|fault| fault.to_string())
}

/// Share of a joint's measured variance that the twin's effort explains beside direction and speed, the slope, and
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
                let sign = if velocity.abs() < MOVES {
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
