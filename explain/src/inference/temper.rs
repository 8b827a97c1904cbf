//! Weight of the likelihood where the model is not quite true.
//!
//! No real arm is as the model says, and thousands of rows then find evidence for anything. The likelihood of each joint is
//! raised to a power below one instead ("coarsened"; Miller and Dunson, "Robust Bayesian Inference via Coarsening", JASA
//! 2019): one over the dispersion of the residual in pieces of recordings that are left out, which is Pearson's statistic
//! over its degrees of freedom (`McCullagh` and Nelder, *Generalized Linear Models*, 1989, section 4.5). The median over
//! the pieces counts, so that an event in one of them is no wrong law. The statistic counts only the functions of the
//! motion in which effects differ, because everything else is noise.

use nalgebra::{DMatrix, SymmetricEigen};

use super::left_out::LeftOut;
use super::remainder::Feature;
use super::space::Space;

/// Smallest weight. Resolution: below it a joint tells next to nothing.
const LEAST: f64 = 0.02;
/// Smallest variance of a combination of features, as a share of the largest. Resolution: of dependent columns.
const DEPENDENT: f64 = 1e-4;

/// Weight of each joint's likelihood, at most 1. `weights` are those that the space has.
pub fn tempers(
    space: &Space,
    left_out: &LeftOut<'_>,
    features: &[Feature],
    pieces: usize,
    weights: &[f64],
) -> Vec<f64> {
    let of = |(joint, weight): (usize, &f64)| {
        let own: Vec<Vec<Vec<f64>>> = (features.iter().filter(|f| f.joint == joint))
            .flat_map(|f| &f.columns)
            .map(|column| space.whitened_by_piece(joint, column, pieces))
            .collect();
        let of_piece = |piece: usize| {
            let residual = left_out.residual(joint, piece, &|_| true);
            let features = DMatrix::from_fn(residual.len(), own.len(), |k, c| own[c][piece][k]);
            let covariance = left_out.covariance(joint, piece, &features);
            let eigen = SymmetricEigen::new(covariance);
            let products = eigen.eigenvectors.tr_mul(&features.tr_mul(&residual));
            let least = DEPENDENT * eigen.eigenvalues.max();
            let (mut square, mut freedom) = (0.0, 0.0);
            for (variance, product) in eigen.eigenvalues.iter().zip(products.iter()) {
                if *variance > least && least > 0.0 {
                    square += product * product / variance;
                    freedom += 1.0;
                }
            }
            (freedom > 0.0).then_some(square / freedom)
        };
        let mut dispersions: Vec<f64> = (0..pieces).filter_map(of_piece).collect();
        dispersions.sort_by(f64::total_cmp);
        let dispersion = dispersions.get(dispersions.len() / 2).map_or(1.0, |d| *d);
        (weight / dispersion).clamp(LEAST, 1.0)
    };
    weights.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use crate::fit::fitted::Fit;
    use crate::fixture::problem_with;
    use crate::inference::nuisance;
    use crate::inference::state::State;
    use crate::inference::tangents;

    /// The weight of the second joint's likelihood, where no effect explains its effort.
    fn weight(add: impl FnMut(&[f64], &[f64], &mut [f64])) -> f64 {
        let problem = problem_with(7, add);
        let mut state = State::new(&problem, true);
        let fit = Fit::new(&problem, Vec::new());
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(&problem, &fit, &sizes, true, state.scales);
        let measured = tangents::measured(&problem, &fit);
        state.estimate_noise(&fit, &nuisances, &[], &measured, true);
        state.estimate_tempers(&fit, &nuisances, &[], &measured);
        state.tempers[1]
    }

    #[test]
    fn an_arm_as_its_urdf_says_has_its_whole_weight() {
        assert!(weight(|_, _, _| {}) > 0.7);
    }

    #[test]
    fn a_law_that_one_recording_contradicts_has_little() {
        let mut samples = 0;
        let weight = weight(|_, qd, effort| {
            let sign = if samples < 2000 { 1.0 } else { -1.0 };
            effort[1] += 0.3 * sign * qd[1];
            samples += 1;
        });
        assert!(weight < 0.3, "{weight}");
    }
}
