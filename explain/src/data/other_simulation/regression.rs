//! Regressions on the expected differences between two simulations of one arm at a joint.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::sign;

use crate::data::problem::Problem;
use crate::data::track::Track;

/// Ridge added to the diagonal of the scaled normal equations, which is 1.
/// Resolution: guards the inverse of dependent columns.
const RIDGE: f64 = 1e-6;

/// Filters a function of sample and joint into a signal.
fn signal_of(problem: &Problem, value: impl Fn(&Track, usize) -> f64) -> Vec<f64> {
    let n = problem.joints;
    let of = |track: &Track| (0..n * track.len()).map(|at| value(track, at)).collect();
    let all: Vec<Vec<f64>> = problem.tracks.iter().map(|t| of(&t.track)).collect();
    problem.signal(&all)
}

/// Returns the columns in which two simulations of one arm may differ at a joint: an offset, Coulomb and viscous
/// friction.
pub fn plain_columns(problem: &Problem) -> Vec<Vec<f64>> {
    vec![
        signal_of(problem, |_, _| 1.0),
        signal_of(problem, |track, at| sign(track.velocity[at])),
        signal_of(problem, |track, at| track.velocity[at]),
    ]
}

/// Returns [`plain_columns`] and the variables that effects in a joint depend on: acceleration, position and the
/// twin's effort.
pub fn rich_columns(problem: &Problem) -> Vec<Vec<f64>> {
    let mut columns = plain_columns(problem);
    columns.push(signal_of(problem, |track, at| track.acceleration[at]));
    columns.push(signal_of(problem, |track, at| track.position[at]));
    columns.push(problem.rigid().to_vec());
    columns
}

/// Returns the residual of the weighted regression of `signal` on `columns` at a joint, at all rows.
pub fn regressed(
    problem: &Problem,
    columns: &[Vec<f64>],
    signal: &[f64],
    joint: usize,
    weight: &[f64],
) -> Vec<f64> {
    let rows = problem.joint_rows(joint);
    let mut left = signal[rows.clone()].to_vec();
    let factors = factors(problem, columns, signal, joint, weight);
    for (factor, column) in factors.into_iter().zip(columns) {
        for (left, value) in left.iter_mut().zip(&column[rows.clone()]) {
            *left -= factor * value;
        }
    }
    left
}

/// Returns the coefficients of the weighted regression of `signal` on `columns` at a joint; none if the columns are
/// dependent.
pub fn factors(
    problem: &Problem,
    columns: &[Vec<f64>],
    signal: &[f64],
    joint: usize,
    weight: &[f64],
) -> Vec<f64> {
    let rows = problem.joint_rows(joint);
    let own: Vec<&[f64]> = columns.iter().map(|column| &column[rows.clone()]).collect();
    let signal = &signal[rows];
    let dot = |x: &[f64], y: &[f64]| -> f64 {
        let each = x.iter().zip(y).zip(weight);
        each.map(|((x, y), w)| w * x * y).sum()
    };
    let p = own.len();
    let scale: Vec<f64> = own
        .iter()
        .map(|x| dot(x, x).max(f64::MIN_POSITIVE.sqrt()).sqrt())
        .collect();
    let mut gram = DMatrix::from_fn(p, p, |a, b| dot(own[a], own[b]) / (scale[a] * scale[b]));
    for a in 0..p {
        gram[(a, a)] += RIDGE;
    }
    let right = DVector::from_fn(p, |a, _| dot(own[a], signal) / scale[a]);
    let Some(factored) = gram.cholesky() else {
        return Vec::new();
    };
    let theta = factored.solve(&right);
    (0..p).map(|a| theta[a] / scale[a]).collect()
}

/// Returns the effective number of independent rows among those with weight: `n (1 - r) / (1 + r)` with r the
/// correlation of neighbouring rows (Bayley and Hammersley, "The 'Effective' Number of Independent Observations in an
/// Autocorrelated Time Series", 1946).
pub fn independent_rows(left: &[f64], weight: &[f64]) -> f64 {
    let (mut product, mut square) = (0.0, f64::MIN_POSITIVE);
    for (x, w) in left.windows(2).zip(weight.windows(2)) {
        let both = w[0] * w[1];
        product += both * x[0] * x[1];
        square += 0.5 * both * (x[0] * x[0] + x[1] * x[1]);
    }
    let r = (product / square).max(0.0);
    (1.0 - r) / (1.0 + r) * weight.iter().sum::<f64>()
}

/// Returns the upper median; 0 without values.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Returns the distance between the 1 % and the 99 % quantile.
pub fn range(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let last = sorted.len().saturating_sub(1) as f64;
        sorted.get((share * last) as usize).copied().unwrap_or(0.0)
    };
    at(0.99) - at(0.01)
}
