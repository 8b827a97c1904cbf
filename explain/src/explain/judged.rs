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
    /// The initial twin, with its unknown torque scales fitted.
    pub before: Fit,
    /// The twin with the effects of the explanation.
    pub found: Fit,
    /// The findings.
    pub named: Named,
    /// Detection limits of the effects.
    pub undetectable: Vec<Undetectable>,
    /// Joints that keep the initial twin.
    pub kept: Vec<usize>,
    /// Features that predict the residual of the fitted recordings.
    pub remaining: Vec<Predicted>,
}

/// Reason why a search did not begin.
pub enum Stop {
    /// The recordings allow no verdict.
    Reason(String),
    /// The recordings must be corrected first.
    Slips(Vec<Slip>),
}
