//! The verdict of an explanation.

use tauscope_dynamics::terms::UNKNOWN;

use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::report::schema::{Finding, Remaining, Verdict};

/// The verdict, given what remains beyond the noise. Where the `twin_is_topic`, a remainder beside findings decides
/// nothing: another simulation has its own delays and friction, and they are no physics of the arm.
pub fn verdict(
    found: &Fit,
    findings: &[Finding],
    remaining: &[Remaining],
    twin_is_topic: bool,
) -> Verdict {
    let described = |active: &Active| active.hypothesis.said() == UNKNOWN.name;
    let described = found.actives.iter().any(described);
    let of_the_arm = !remaining.is_empty() && (!twin_is_topic || findings.is_empty());
    if described || of_the_arm {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}
