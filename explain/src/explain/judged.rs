//! The result of a search, and the findings in it.

use crate::data::problem::Problem;
use crate::data::remedies::Slip;
use crate::fit::fitted::Fit;
use crate::inference::remainder::Predicted;
use crate::report::findings::Named;
use crate::report::schema::Undetectable;

/// The result of a search.
pub struct Judged {
    /// The recordings that were fitted.
    pub problem: Problem,
    /// The twin as it was, with its unknown torque scales fitted.
    pub before: Fit,
    /// The twin with the effects that were found.
    pub found: Fit,
    /// The findings.
    pub named: Named,
    /// The smallest effects that would have been found.
    pub undetectable: Vec<Undetectable>,
    /// Joints that keep the twin as it was.
    pub kept: Vec<usize>,
    /// Features that predict the residual of the fitted recordings.
    pub remaining: Vec<Predicted>,
}

/// Why a search did not begin.
pub enum Stop {
    /// The recordings allow no verdict.
    Reason(String),
    /// They must be mended first.
    Slips(Vec<Slip>),
}
