//! The verdict of an explanation.

use tauscope_dynamics::terms::UNKNOWN;

use crate::report::schema::{Finding, Remaining, Verdict};

/// The verdict, given what remains beyond the noise. Where the `twin_is_topic`, a remainder beside findings decides
/// nothing: another simulation has its own delays and friction, and they are no physics of the arm.
pub fn verdict(findings: &[Finding], remaining: &[Remaining], twin_is_topic: bool) -> Verdict {
    let described = findings.iter().any(|f| f.effect == UNKNOWN.name);
    let of_the_arm = !remaining.is_empty() && (!twin_is_topic || findings.is_empty());
    if described || of_the_arm {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}
