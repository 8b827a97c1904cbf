//! Which corrections are handed out: none that makes a joint worse.
//!
//! Neither the written twin nor its predictions may depend on the efforts of held-out recordings. So a joint keeps the twin
//! as it was if its correction does worse than none on fitted recordings, each left out in turn.

use crate::data::problem::Problem;
use crate::fit::cross_validation::left_elsewhere;
use crate::fit::fitted::Fit;
use crate::report::sentences::UNCHANGED;

/// A correction is handed out if it leaves at most this share of the squares of recordings left out: less is what one
/// recording differs from another by.
/// Tuned: by hand, on no recorded seeds; not swept.
const MOST_LEFT: f64 = 0.97;

/// The joints whose correction predicts recordings left out of the fit no better than the twin `before` it.
pub fn not_carried(problem: &Problem, before: &Fit, found: &Fit) -> Vec<usize> {
    if problem.tracks.len() < 2 {
        return Vec::new();
    }
    // What acts once is not part of the prediction of other recordings.
    let lasts = |j: usize| {
        let mut all = found.actives.iter().map(|active| &active.hypothesis);
        all.any(|h| h.lasts() && !h.is_torque_scale() && h.only_joint().is_none_or(|own| own == j))
    };
    let changed = |&j: &usize| lasts(j) && found.squares[j] < UNCHANGED * before.squares[j];
    let no_better = |&j: &usize| {
        left_elsewhere(problem, found, j) > MOST_LEFT * left_elsewhere(problem, before, j)
    };
    let all = (0..problem.joints).filter(changed);
    all.filter(no_better).collect()
}
