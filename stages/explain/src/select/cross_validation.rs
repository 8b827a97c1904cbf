//! Whether a piece of physics carries over from some recordings to the others.

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::fit::refine::Anchor;
use crate::select::parallel;

/// Least share of what a piece of physics gains where it is fitted that it must gain where it is not.
const LEAST_SHARE: f64 = 0.4;
/// Weight of the numbers as fitted on all recordings, relative to what those tell of them: what the other recordings do
/// not know stays as it is.
const DAMPING: f64 = 0.02;

/// Whether what `with` has and `without` has not predicts recordings that it was not fitted on: each recording is left out
/// in turn, all numbers are fitted on the others to first order, and the errors on it are compared.
///
/// What shows in one recording alone cannot be judged so and passes. `joints` are those that differ.
pub fn carries_over(problem: &Problem, with: &Fit, without: &Fit, joints: &[usize]) -> bool {
    if problem.tracks.len() < 2 {
        return true;
    }
    let gain = |with_left: &[f64], without_left: &[f64]| -> f64 {
        let of = |&j: &usize| (without_left[j] - with_left[j]) / with.variance[j];
        joints.iter().map(of).sum()
    };
    let fitted = gain(&with.squares, &without.squares);
    let elsewhere = gain(
        &left_where_not_fitted(problem, with, joints),
        &left_where_not_fitted(problem, without, joints),
    );
    elsewhere > LEAST_SHARE * fitted
}

/// Sum of squares that a fit leaves at a joint in each recording with the numbers that the others give what touches the joint,
/// shapes and all; what the others do not know stays nearly as it is.
pub fn left_elsewhere(problem: &Problem, fit: &Fit, joint: usize) -> f64 {
    let tracks: Vec<usize> = (0..problem.tracks.len()).collect();
    let anchor = Anchor::new(problem, fit, &[joint], DAMPING);
    let left = parallel::map(&tracks, |&track| {
        let others = problem.without(track);
        let known = Fit::beside(&others, fit.actives.clone(), Some(fit));
        let refitted = known.refined_near(&others, &[joint], &anchor);
        Products::new(problem, &[], &refitted.residual, Some(track)).square[joint]
    });
    left.iter().sum()
}

/// Sum of squares by joint that a fit leaves in each recording with the numbers of the others.
fn left_where_not_fitted(problem: &Problem, fit: &Fit, joints: &[usize]) -> Vec<f64> {
    let jacobian = fit.jacobian_at(problem, Some(joints));
    // Shapes stay as they are: to first order they would run away.
    let factors = fit.parameters_at(Some(joints)).into_iter();
    let factors = factors.map(|(index, c)| fit.is_factor(index, c));
    let columns = jacobian.iter().zip(factors).filter(|(_, factor)| *factor);
    let columns: Vec<&Column> = columns.map(|(column, _)| column.as_ref()).collect();
    let all = Products::new(problem, &columns, &fit.residual, None);
    let (normal, _) = all.normal(&fit.variance, &vec![0.0; columns.len()]);
    let ridge: Vec<f64> = normal.diagonal().iter().map(|d| DAMPING * d).collect();
    let used = vec![true; columns.len()];
    let mut left = vec![0.0; problem.joints];
    for track in 0..problem.tracks.len() {
        let own = Products::new(problem, &columns, &fit.residual, Some(track));
        let others = all.without(&own);
        let own_left = match others.solve(&fit.variance, &ridge, &used) {
            Some(step) => own.all_left(&step),
            None => own.square,
        };
        for (sum, own) in left.iter_mut().zip(own_left) {
            *sum += own;
        }
    }
    left
}
