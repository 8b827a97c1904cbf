//! The verdict of an explanation.

use tauscope_dynamics::terms::UNKNOWN;

use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::report::schema::{Finding, Remaining, Verdict};

/// The verdict, given what remains beyond the noise.
pub fn verdict(found: &Fit, findings: &[Finding], remaining: &[Remaining]) -> Verdict {
    let described = |active: &Active| active.hypothesis.said() == UNKNOWN.name;
    let described = found.actives.iter().any(described);
    if described || !remaining.is_empty() {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}
