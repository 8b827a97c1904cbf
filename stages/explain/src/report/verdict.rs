//! The verdict of an explanation.

use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::report::schema::{Finding, Remaining, Verdict};

/// The verdict, given what remains beyond the noise.
pub fn verdict(found: &Fit, findings: &[Finding], remaining: &[Remaining]) -> Verdict {
    let described = found.actives.iter().any(Active::is_unnamed);
    if described || !remaining.is_empty() {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}
