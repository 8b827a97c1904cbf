//! Residual of a fit in recordings that are left out of it.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::fit::refine::Anchor;
use crate::parallel;

/// Weight of the parameters fitted on all recordings, relative to the information of all recordings. A parameter on
/// which the other recordings have no information keeps its value.
/// Tuned: by hand, on no recorded seeds; not swept.
const DAMPING: f64 = 0.02;

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
