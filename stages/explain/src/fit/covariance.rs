//! Covariance of the numbers of an explanation: from noise that is correlated in time, and from errors of the URDF's
//! bodies that no finding names.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use crate::data::column::Column;
use crate::data::noise::MEDIAN_OF_ABS_NORMAL;
use crate::data::problem::Problem;
use crate::fit::body_prior;
use crate::fit::disagreement::Disagreement;
use crate::fit::fitted::{Fit, LEAST_VARIANCE};
use crate::fit::urdf_uncertainty::usual_errors;
use crate::physics::active::Hypothesis;

/// Lags over which a prewhitened score is taken to be correlated, in compared samples.
/// Tuned: by hand, on no recorded seeds; not swept.
pub(crate) const LAGS: usize = 6;
/// No score is taken to keep more of itself than this from one compared sample to the next.
/// Statistical: the bound of Andrews and Monahan, section 4.
const MOST_KEPT: f64 = 0.97;
/// Added to the diagonal of the normal matrix, scaled to 1.
/// Resolution: far above the rounding of f64, far below what the noise hides.
const RIDGE: f64 = 1e-9;
/// Bodies are not taken to be off by more than so many usual errors.
/// Physical: a mass that is off by a fifth is a finding.
const LARGEST_ERROR: f64 = 2.0;

/// Covariance of all free coordinates of a fit, in the order of [`Fit::parameters`], from the noise.
///
/// The sandwich `A⁻¹ B A⁻¹` with A the normal matrix and B the covariance of the scores, but never less than white noise
/// of the variance that is left gives, and for each number no less than recordings disagree by, if that is more than chance.
pub fn covariance(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    Normal::of(problem, fit, &fit.jacobian(problem)).covariance(fit.parameters().len())
}

/// The same, and from errors of the URDF's bodies: each mass and centre of mass is off by chance, all of them by the same
/// share of a usual error, a variance component (Searle, Casella and `McCulloch`, *Variance Components*, 1992, chapter 5)
/// that follows from what the residual has in common with their columns, and from the bodies that were fitted.
pub fn covariance_beside_bodies(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    let mut columns = fit.jacobian(problem);
    let own = columns.len();
    columns.extend(usual_errors(problem, fit));
    let normal = Normal::of(problem, fit, &columns);
    let mut covariance = normal.covariance(own);
    let bodies = normal.matrix.nrows() - own;
    let Some(inverse) = normal.inverse(own).filter(|_| bodies > 0) else {
        return covariance;
    };
    let shared = normal.matrix.view((0, own), (own, bodies));
    // What a usual error of each body does to each number.
    let pull = &inverse * shared;
    let size = normal.size_of_errors(own, &pull, fitted_errors(problem, fit, &covariance));
    covariance += &pull * pull.transpose() * (size * size);
    covariance
}

/// The errors of masses and centres of mass that were fitted, in usual ones, as far as the noise lets them be told.
fn fitted_errors(problem: &Problem, fit: &Fit, covariance: &DMatrix<f64>) -> Vec<f64> {
    let of_coordinates = fit.actives.iter().flat_map(|active| {
        let Hypothesis { effect, place } = active.hypothesis;
        let off = effect
            .traits
            .off_in_urdf
            .map(|off| off(&problem.model.links()[place.link]));
        active.coordinates.iter().map(move |value| (value, off))
    });
    let told = |(k, (value, off)): (usize, (&f64, Option<f64>))| {
        let off = off?;
        (covariance[(k, k)] < off * off)
            .then(|| (value * value - covariance[(k, k)]).max(0.0).sqrt() / off)
    };
    of_coordinates.enumerate().filter_map(told).collect()
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

    /// The error of bodies, in usual ones, that the residual has in common with their columns: the median over directions
    /// in which bodies may be off and over the `fitted` errors, so that what else is left in some of them counts little.
    /// `pull` is what a usual error of each does to the first `own` numbers, which were fitted.
    fn size_of_errors(&self, own: usize, pull: &DMatrix<f64>, fitted: Vec<f64>) -> f64 {
        let bodies = pull.ncols();
        let shared = self.matrix.view((0, own), (own, bodies));
        // What is left of each column beside those that were fitted. Their right side is zero.
        let told = self.matrix.view((own, own), (bodies, bodies)) - shared.transpose() * pull;
        let right = self.right.rows(own, bodies);
        let mut left = DMatrix::zeros(bodies, own + bodies);
        left.view_mut((0, 0), (bodies, own))
            .copy_from(&-pull.transpose());
        left.view_mut((0, own), (bodies, bodies))
            .fill_with_identity();
        let spread = &left * &self.spread * left.transpose();
        let directions = SymmetricEigen::new(told);
        // Of each direction that would show a usual error: the error that its right side tells of, less what chance adds.
        let of_direction = |i: usize| {
            let (told, way) = (directions.eigenvalues[i], directions.eigenvectors.column(i));
            let by_chance = (way.transpose() * &spread * way)[0].max(told);
            let beyond = (way.dot(&right).powi(2) - by_chance).max(0.0);
            (told > 0.0 && told * told > by_chance).then(|| beyond.sqrt() / told)
        };
        let mut errors: Vec<f64> = (0..bodies).filter_map(of_direction).chain(fitted).collect();
        errors.sort_by(f64::total_cmp);
        let median = errors.get(errors.len() / 2).copied().unwrap_or(0.0);
        (median / MEDIAN_OF_ABS_NORMAL).min(LARGEST_ERROR)
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

    /// The normal equations of one number and five bodies, each direction of which tells a usual error of itself tenfold
    /// its noise; `errors` is what the residual has of each.
    fn beside(errors: [f64; 5]) -> Normal {
        let mut right = DVector::zeros(6);
        for (k, error) in errors.iter().enumerate() {
            right[k + 1] = 100.0 * error;
        }
        Normal {
            matrix: DMatrix::from_diagonal_element(6, 6, 100.0),
            right,
            spread: DMatrix::from_diagonal_element(6, 6, 100.0),
            by_recording: DMatrix::zeros(6, 1),
        }
    }

    fn size(errors: [f64; 5]) -> f64 {
        beside(errors).size_of_errors(1, &DMatrix::zeros(1, 5), Vec::new())
    }

    #[test]
    fn errors_of_bodies_are_told_by_what_most_directions_have_in_common_with_the_residual() {
        let all = size([0.5, -0.3, 0.6, -0.4, 0.2]);
        assert!((0.4..0.8).contains(&all), "{all}");
        // Noise alone, and something else that is left in one direction.
        assert!(size([0.1, -0.08, 0.05, -0.1, 0.02]) <= 0.0);
        assert!(size([0.05, -0.08, 30.0, -0.1, 0.02]) <= 0.0);
        assert!(size([9.0; 5]) >= LARGEST_ERROR);
    }

    #[test]
    fn bodies_that_were_fitted_tell_how_far_the_others_are_off() {
        let size = |fitted: &[f64]| {
            let unseen = beside([0.0; 5]).size_of_errors(1, &DMatrix::zeros(1, 5), Vec::new());
            let beside = beside([0.0; 5]).size_of_errors(1, &DMatrix::zeros(1, 5), fitted.to_vec());
            assert!(unseen <= 0.0);
            beside
        };
        // One link that is another beside five that are right; most of what can be told is off.
        assert!(size(&[6.0]) <= 0.0);
        assert!(size(&[0.8, 0.7, 0.9, 1.1, 0.6, 0.9]) > 0.5);
    }

    #[test]
    fn bodies_as_in_the_urdf_hardly_widen_an_interval() {
        let data = problem_with(3, |_, _, _| {});
        let active = at_joint("viscous_friction", 0).with(vec![0.0]);
        let fit = Fit::new(&data, vec![active]).refined(&data);
        let half = |spread: &DMatrix<f64>| parameter_deviations(&data, &fit, spread, 0)[0];
        let by_noise = half(&covariance(&data, &fit));
        let with_bodies = half(&covariance_beside_bodies(&data, &fit));
        assert!(with_bodies < 1.3 * by_noise, "{by_noise} {with_bodies}");
    }
}
