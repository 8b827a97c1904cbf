//! Effective sample size: neighbouring rows of correlated noise count as less than one independent sample each. The
//! correlation is estimated on the residual of a rich regression.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{MotionSample, sign};

use crate::data::problem::Problem;

/// Rows of a stretch for which one correlation is estimated.
/// Tuned: by hand, on no recorded seeds; not swept.
const STRETCH_ROWS: usize = 20;
/// Quantile of the stretches' correlations that is used. A low one, because the remains of a push or of a worn place
/// in some stretches are not noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const CALM: f64 = 0.3;
/// How far that quantile lies below the true correlation by chance.
/// Statistical: the correlation of 20 rows of white noise has a standard deviation of 1/√20 = 0.22, and the 30 %
/// quantile of a normal variable lies 0.52 standard deviations below its mean.
const CALM_BIAS: f64 = 0.12;
/// A row counts as at least this share of an independent sample.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST: f64 = 0.03;
/// Stribeck velocities of the rich regression \[rad/s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const STRIBECK_RAD_S: [f64; 2] = [0.05, 0.3];
/// The rich regression needs this many rows per column.
/// Tuned: by hand, on no recorded seeds; not swept.
const ROWS_PER_COLUMN: usize = 3;
/// Added to the diagonal of the scaled normal equations, whose elements are 1.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-8;

/// Effective samples per row, by joint, 0 to 1: `(1 - r) / (1 + r)` with r the correlation of neighbouring rows, as for
/// a first-order autoregression.
///
/// The noise is the residual of a regression on many functions of the joint's motion and of all efforts. The regression
/// names nothing, but removes most of any effect in the joint.
pub fn per_row(problem: &Problem) -> Vec<f64> {
    (0..problem.joints)
        .map(|joint| {
            let left = left_by_rich_model(problem, joint);
            of_left(problem, joint, &left)
        })
        .collect()
}

fn of_left(problem: &Problem, joint: usize, left: &[f64]) -> f64 {
    let r = (calm_correlation(problem, joint, left) + CALM_BIAS).clamp(0.0, 1.0);
    ((1.0 - r) / (1.0 + r)).clamp(LEAST, 1.0)
}

/// The columns of the rich regression of joint `j` at one instant.
fn functions(j: usize, at: &MotionSample<'_>, into: &mut Vec<f64>) {
    let (q, qd, s) = (at.position[j], at.velocity[j], sign(at.velocity[j]));
    let load = at.transmitted[j];
    into.extend([
        1.0,
        s,
        qd,
        qd * qd.abs(),
        at.acceleration[j],
        q,
        q.sin(),
        q.cos(),
        load.abs() * s,
    ]);
    into.extend(STRIBECK_RAD_S.map(|v| (-(qd / v) * (qd / v)).exp() * s));
    into.extend_from_slice(at.transmitted);
}

fn left_by_rich_model(problem: &Problem, joint: usize) -> Vec<f64> {
    let rows = problem.joint_rows(joint);
    let n = problem.joints;
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for track in &problem.tracks {
        let mut values: Vec<f64> = Vec::new();
        let mut before: Option<f64> = None;
        let mut count = 0;
        track.track.each(|_, at| {
            let first = values.len();
            functions(joint, at, &mut values);
            // A delay adds the rate of change of the load.
            let load = at.transmitted[joint];
            let rate = before.map_or(0.0, |b| {
                if at.dt_s > 0.0 {
                    (load - b) / at.dt_s
                } else {
                    0.0
                }
            });
            values.push(rate);
            before = Some(load);
            count = values.len() - first;
        });
        columns.resize(count, Vec::new());
        for (c, column) in columns.iter_mut().enumerate() {
            let signal = values.iter().skip(c).step_by(count).copied().collect();
            let mut compared = vec![0.0; track.compared.len()];
            track.compare(joint, signal, &mut compared);
            column.extend(compared);
        }
    }
    let used: Vec<usize> = (0..problem.rows)
        .filter(|&row| problem.weight[rows.start + row] > 0.0)
        .collect();
    let p = columns.len();
    let rigid: Vec<Vec<f64>> = problem
        .tracks
        .iter()
        .map(|t| t.track.rigid.clone())
        .collect();
    let mut left = vec![0.0; problem.rows];
    problem.joint_signal(&rigid, joint, &mut left);
    for (left, measured) in left.iter_mut().zip(&problem.measured[rows]) {
        *left = measured - *left;
    }
    if used.len() < ROWS_PER_COLUMN * (p + n) {
        return left;
    }
    let scale: Vec<f64> = columns
        .iter()
        .map(|c| {
            used.iter()
                .map(|&row| c[row] * c[row])
                .sum::<f64>()
                .sqrt()
                .max(1e-12)
        })
        .collect();
    let x = DMatrix::from_fn(used.len(), p, |a, b| columns[b][used[a]] / scale[b]);
    let y = DVector::from_iterator(used.len(), used.iter().map(|&row| left[row]));
    let mut normal = x.transpose() * &x;
    for a in 0..p {
        normal[(a, a)] += RIDGE;
    }
    if let Some(factor) = normal.cholesky() {
        let rest = &y - &x * factor.solve(&(x.transpose() * &y));
        for (rest, &row) in rest.iter().zip(&used) {
            left[row] = *rest;
        }
    }
    left
}

/// Correlation of neighbouring rows: the [`CALM`] quantile over all stretches.
fn calm_correlation(problem: &Problem, joint: usize, left: &[f64]) -> f64 {
    let first = joint * problem.rows;
    let mut stretches: Vec<f64> = Vec::new();
    for track in &problem.tracks {
        let rows: Vec<usize> = track.rows().collect();
        for stretch in rows.chunks(STRETCH_ROWS) {
            let (mut product, mut square, mut pairs) = (0.0, 0.0, 0);
            for pair in stretch.windows(2) {
                if problem.weight[first + pair[0]] > 0.0 && problem.weight[first + pair[1]] > 0.0 {
                    let (a, b) = (left[pair[0]], left[pair[1]]);
                    product += a * b;
                    square += 0.5 * (a * a + b * b);
                    pairs += 1;
                }
            }
            if pairs >= STRETCH_ROWS / 2 && square > 0.0 {
                stretches.push(product / square);
            }
        }
    }
    stretches.sort_by(f64::total_cmp);
    stretches
        .get((CALM * stretches.len() as f64) as usize)
        .copied()
        .unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Noise, model, problem, recording};

    /// Effective samples per row of the first joint, with noise that keeps `share` of itself from sample to sample.
    fn with_noise(share: f64) -> f64 {
        let model = model();
        let mut noise = Noise(7);
        let mut last = 0.0;
        let of = |seed| {
            recording(&model, seed, |_, _, effort| {
                last = share * last + (1.0 - share * share).sqrt() * noise.next();
                effort[0] += 0.2 * last;
            })
        };
        let recordings: Vec<_> = [1, 2].map(of).into();
        per_row(&problem(&model, &recordings))[0]
    }

    #[test]
    fn rows_of_slow_noise_count_less_than_rows_of_white_noise() {
        let (white, slow) = (with_noise(0.0), with_noise(0.99));
        assert!(white > 0.5, "{white}");
        assert!(slow < 0.5 * white, "{slow} of {white}");
        assert!(slow >= LEAST);
    }
}
