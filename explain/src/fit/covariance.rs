//! Covariance of the numbers of a fit from noise that is correlated in time.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::disagreement::Disagreement;
use crate::fit::fitted::{Fit, LEAST_VARIANCE};

/// Lags over which a prewhitened score is taken to be correlated, in compared samples.
/// Tuned: by hand, on no recorded seeds; not swept.
pub(crate) const LAGS: usize = 6;
/// No score is taken to keep more of itself than this from one compared sample to the next.
/// Statistical: the bound of Andrews and Monahan, section 4.
const MOST_KEPT: f64 = 0.97;
/// Added to the diagonal of the normal matrix, scaled to 1.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;

/// Covariance of all free coordinates of a fit, in the order of [`Fit::parameters`], from the noise.
///
/// The sandwich `A⁻¹ B A⁻¹` with A the normal matrix and B the covariance of the scores, but never less than white noise
/// of the variance that is left gives, and for each number no less than recordings disagree by, if that is more than chance.
pub fn covariance(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    Normal::of(problem, fit, &fit.jacobian(problem)).covariance(fit.parameters().len())
}

/// The normal equations of a fit at its numbers, and how far chance moves their right side.
struct Normal {
    /// Columns with columns, over the variance that is left.
    matrix: DMatrix<f64>,
    /// Columns with the residual: zero for those that were fitted.
    right: DVector<f64>,
    /// Covariance of `right`.
    spread: DMatrix<f64>,
    /// What each recording adds to `right`, one column each.
    by_recording: DMatrix<f64>,
}

impl Normal {
    fn of(problem: &Problem, fit: &Fit, columns: &[Arc<Column>]) -> Self {
        let p = columns.len();
        let mut normal = Self {
            matrix: DMatrix::zeros(p, p),
            right: DVector::zeros(p),
            spread: DMatrix::zeros(p, p),
            by_recording: DMatrix::zeros(p, problem.tracks.len()),
        };
        for joint in 0..problem.joints {
            normal.add(problem, fit, columns, joint);
        }
        // The prior counts as if it had been measured, too.
        let (known, _) = body_prior::normal(&problem.model, &fit.actives, &fit.parameters());
        let own = known.nrows();
        let mut fitted = normal.matrix.view_mut((0, 0), (own, own));
        fitted += &known;
        let mut fitted = normal.spread.view_mut((0, 0), (own, own));
        fitted += &known;
        normal
    }

    /// Adds the rows of a joint.
    ///
    /// Scores are correlated in time. What each keeps from row to row is taken out (prewhitening; Andrews and Monahan, "An
    /// Improved Heteroskedasticity and Autocorrelation Consistent Covariance Matrix Estimator", 1992), the covariance of
    /// the rest is summed over [`LAGS`] with Bartlett's weights (Newey and West, "A Simple, Positive Semi-Definite,
    /// Heteroskedasticity and Autocorrelation Consistent Covariance Matrix", 1987), and put in again.
    fn add(&mut self, problem: &Problem, fit: &Fit, columns: &[Arc<Column>], joint: usize) {
        let touching: Vec<(usize, &[f64])> = columns
            .iter()
            .enumerate()
            .filter_map(|(a, column)| Some((a, column.of_joint(joint, problem.rows)?)))
            .collect();
        let fitted = fit.parameters().len();
        let free = touching.iter().filter(|(a, _)| *a < fitted).count();
        let variance = fit.squares[joint] / (fit.count[joint] - free as f64).max(1.0);
        let variance = variance.max(LEAST_VARIANCE);
        let rows = problem.joint_rows(joint);
        let (weight, residual) = (&problem.weight[rows.clone()], &fit.residual[rows]);
        let k = touching.len();
        let mut matrix = DMatrix::<f64>::zeros(k, k);
        let mut scores: Vec<Vec<DVector<f64>>> = Vec::new();
        for track in &problem.tracks {
            let mut of_track = Vec::new();
            for row in track.rows() {
                if weight[row] <= 0.0 {
                    of_track.push(DVector::zeros(k));
                    continue;
                }
                let column = DVector::from_iterator(k, touching.iter().map(|(_, x)| x[row]));
                matrix.ger(1.0 / variance, &column, &column, 1.0);
                of_track.push(column * (residual[row] / variance));
            }
            scores.push(of_track);
        }
        let spread = long_run(&scores, k);
        for (i, (a, _)) in touching.iter().enumerate() {
            for (r, of_track) in scores.iter().enumerate() {
                let score: f64 = of_track.iter().map(|s| s[i]).sum();
                self.by_recording[(*a, r)] += score;
                self.right[*a] += score;
            }
            for (j, (b, _)) in touching.iter().enumerate() {
                self.matrix[(*a, *b)] += matrix[(i, j)];
                self.spread[(*a, *b)] += spread[(i, j)];
            }
        }
    }

    /// Inverse of the part of the matrix that belongs to the first `own` columns.
    fn inverse(&self, own: usize) -> Option<DMatrix<f64>> {
        let normal = self.matrix.view((0, 0), (own, own));
        // What no row depends on has no scale of its own, such as an end that lies beside a recording.
        let scale = |a: usize| normal[(a, a)].max(0.0).sqrt();
        let scale: Vec<f64> = (0..own)
            .map(scale)
            .map(|s| if s > 0.0 { s } else { 1.0 })
            .collect();
        let mut scaled = DMatrix::from_fn(own, own, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
        for a in 0..own {
            scaled[(a, a)] += RIDGE;
        }
        let inverse = scaled.try_inverse()?;
        Some(DMatrix::from_fn(own, own, |a, b| {
            inverse[(a, b)] / (scale[a] * scale[b])
        }))
    }

    /// Covariance of the first `own` coordinates from the noise.
    fn covariance(&self, own: usize) -> DMatrix<f64> {
        let Some(inverse) = self.inverse(own) else {
            return DMatrix::from_diagonal_element(own, own, f64::INFINITY);
        };
        let mut covariance = &inverse * self.spread.view((0, 0), (own, own)) * &inverse;
        let disagree = Disagreement::of(&inverse * self.by_recording.rows(0, own));
        for a in 0..own {
            let robust = covariance[(a, a)];
            let white = robust.max(inverse[(a, a)]);
            let wide = white.max(disagree.beyond_chance(a, white));
            // Zero is what no row depends on: it stays so.
            if robust > 0.0 && robust < wide {
                let grow = (wide / robust).sqrt();
                for b in 0..own {
                    covariance[(a, b)] *= grow;
                    covariance[(b, a)] *= grow;
                }
            }
        }
        covariance
    }
}

/// Covariance of the sum of scores of `k` numbers, by track and row.
fn long_run(scores: &[Vec<DVector<f64>>], k: usize) -> DMatrix<f64> {
    let (mut product, mut square) = (DVector::<f64>::zeros(k), DVector::<f64>::zeros(k));
    for of_track in scores {
        for pair in of_track.windows(2) {
            product += pair[0].component_mul(&pair[1]);
            square += 0.5 * (pair[0].component_mul(&pair[0]) + pair[1].component_mul(&pair[1]));
        }
    }
    let kept = product.zip_map(&square, |product, square| {
        if square > 0.0 {
            (product / square).clamp(0.0, MOST_KEPT)
        } else {
            0.0
        }
    });
    let mut spread = DMatrix::<f64>::zeros(k, k);
    for of_track in scores {
        let mut past: Vec<DVector<f64>> = Vec::new();
        for (row, score) in of_track.iter().enumerate() {
            let mut whitened = score.clone();
            if row > 0 {
                whitened -= kept.component_mul(&of_track[row - 1]);
            }
            spread.ger(1.0, &whitened, &whitened, 1.0);
            for (lag, earlier) in past.iter().rev().enumerate() {
                let weight = 1.0 - (lag + 1) as f64 / (LAGS + 1) as f64;
                spread.ger(weight, &whitened, earlier, 1.0);
                spread.ger(weight, earlier, &whitened, 1.0);
            }
            past.push(whitened);
            if past.len() > LAGS {
                past.remove(0);
            }
        }
    }
    DMatrix::from_fn(k, k, |a, b| {
        spread[(a, b)] / ((1.0 - kept[a]) * (1.0 - kept[b]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::interval::{half_width_95, parameter_deviations};
    use crate::fixture::{Noise, at_joint, problem_with};

    const TRUE_NM: f64 = 0.8;

    /// An offset of the shoulder's effort and its half width, fitted with noise of 0.3 s from a seed.
    fn offset(seed: u64) -> (f64, f64) {
        let (mut noise, mut last) = (Noise(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1), 0.0);
        let kept = (-0.01_f64 / 0.3).exp();
        let data = problem_with(seed, |_, _, effort| {
            last = kept * last + (1.0 - kept * kept).sqrt() * noise.next();
            effort[0] += TRUE_NM + 0.2 * last;
        });
        let active = at_joint("torque_bias", 0).with(vec![0.0]);
        let fit = Fit::new(&data, vec![active]).refined(&data);
        let spread = covariance(&data, &fit);
        let deviation = parameter_deviations(&data, &fit, &spread, 0)[0];
        (
            fit.actives[0].coordinates[0],
            half_width_95(&data) * deviation,
        )
    }

    #[test]
    fn intervals_hold_the_true_number_beside_slow_noise_too() {
        let all: Vec<(f64, f64)> = (1..=40).map(offset).collect();
        let held = all
            .iter()
            .filter(|(value, half)| (value - TRUE_NM).abs() <= *half);
        assert!(held.count() >= 35, "{all:?}");
    }

    #[test]
    fn a_number_on_which_recordings_disagree_is_known_no_better_than_they_agree() {
        let deviation = |second: f64| {
            let mut sample = 0;
            let data = problem_with(3, |_, qd, effort| {
                effort[0] += if sample < 2000 { 0.6 } else { second } * qd[0];
                sample += 1;
            });
            let active = at_joint("viscous_friction", 0).with(vec![0.0]);
            let fit = Fit::new(&data, vec![active]).refined(&data);
            parameter_deviations(&data, &fit, &covariance(&data, &fit), 0)[0]
        };
        assert!(deviation(0.6) < 0.02, "{}", deviation(0.6));
        // The mean of two numbers that are 0.4 apart.
        assert!((0.1..0.3).contains(&deviation(1.0)), "{}", deviation(1.0));
    }
}
