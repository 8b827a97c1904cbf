//! What a search came to, and what is said of it.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::report::findings::Named;
use crate::report::schema::Undetectable;

/// What a search came to.
pub struct Judged {
    /// The recordings that were fitted.
    pub problem: Problem,
    /// The twin as it was, its scales fitted where nobody knows them.
    pub before: Fit,
    /// The twin as it should be.
    pub found: Fit,
    /// What is said of it.
    pub named: Named,
    /// The smallest effects that would have been found.
    pub undetectable: Vec<Undetectable>,
    /// By joint, whether its standstills count.
    pub rests_count: Vec<bool>,
}
