//! Whether an effect predicts recordings that it was not fitted on.

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::fit::refine::Anchor;
use crate::select::parallel;

/// Share of its gain on fitted recordings that an effect must at least gain on recordings left out.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SHARE: f64 = 0.4;
/// Weight of the parameters fitted on all recordings, relative to the information of all recordings. A parameter on
/// which the other recordings have no information keeps its value.
/// Tuned: by hand, on no recorded seeds; not swept.
const DAMPING: f64 = 0.02;

/// Whether the effects that `with` has and `without` lacks predict recordings that they were not fitted on. Each
/// recording is left out in turn, the factors are fitted on the others, and the errors on it are compared.
///
/// A single recording cannot be judged and passes. `joints` are those at which the two fits differ.
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

/// Sum of squared residuals at a joint over all recordings, each with the parameters fitted on the others. All
/// parameters that touch the joint are refitted, shapes included. Those on which the others have no information
/// nearly keep their values.
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

/// By joint, the sum of squared residuals over all recordings, each with the factors fitted on the others.
fn left_where_not_fitted(problem: &Problem, fit: &Fit, joints: &[usize]) -> Vec<f64> {
    let mut left = vec![0.0; problem.joints];
    for out in left_out(problem, fit, Some(joints)) {
        for (sum, own) in left.iter_mut().zip(out.own) {
            *sum += own;
        }
    }
    left
}

/// A recording, and the factors fitted on the others. All by joint.
#[derive(Debug)]
pub struct LeftOut {
    /// Sum of squared residuals on the recording itself.
    pub own: Vec<f64>,
    /// Rows of it that count.
    pub own_count: Vec<f64>,
    /// Sum of squared residuals on the others, with the factors fitted on all.
    pub others_with: Vec<f64>,
    /// The same with the factors fitted on the others.
    pub others_without: Vec<f64>,
    /// Rows of the others that count.
    pub others_count: Vec<f64>,
}

/// Each recording left out in turn. Shapes keep their values: a first-order step of a shape may be far too long.
pub fn each_left_out(problem: &Problem, fit: &Fit) -> Vec<LeftOut> {
    left_out(problem, fit, None)
}

fn left_out(problem: &Problem, fit: &Fit, joints: Option<&[usize]>) -> Vec<LeftOut> {
    let jacobian = fit.jacobian_at(problem, joints);
    let factors = fit.parameters_at(joints).into_iter();
    let factors = factors.map(|(index, c)| fit.is_factor(index, c));
    let columns = jacobian.iter().zip(factors).filter(|(_, factor)| *factor);
    let columns: Vec<&Column> = columns.map(|(column, _)| column.as_ref()).collect();
    let all = Products::new(problem, &columns, &fit.residual, None);
    let (normal, _) = all.normal(&fit.variance, &vec![0.0; columns.len()]);
    let ridge: Vec<f64> = normal.diagonal().iter().map(|d| DAMPING * d).collect();
    let used = vec![true; columns.len()];
    let of_track = |track: usize| {
        let own = Products::new(problem, &columns, &fit.residual, Some(track));
        let others = all.without(&own);
        let step = others.solve(&fit.variance, &ridge, &used);
        let left = |of: &Products| match &step {
            Some(step) => of.all_left(step),
            None => of.square.clone(),
        };
        LeftOut {
            own: left(&own),
            others_without: left(&others),
            own_count: own.count,
            others_with: others.square,
            others_count: others.count,
        }
    };
    (0..problem.tracks.len()).map(of_track).collect()
}
