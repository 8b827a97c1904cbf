//! The verdict in a sentence.

use crate::report::look_at::look_at;
use crate::report::schema::{Finding, Remaining, Verdict};
use crate::report::sentences::{UNCHANGED, error_left};

/// Returns the verdict in a sentence. `errors` are those on held-out recordings by joint, before and after. If the
/// arm was healthy before and `has_changed`, the likely part is named.
pub fn summary(
    verdict: Verdict,
    findings: &[Finding],
    remaining: &[Remaining],
    joints: &[String],
    errors: [&[f64]; 2],
    has_changed: bool,
) -> String {
    let proof = proof(joints, errors);
    let louder = |a: &&Remaining, b: &&Remaining| a.over_noise().total_cmp(&b.over_noise());
    let remains = remaining.iter().max_by(louder);
    let remains = remains.map_or("", |remaining| remaining.sentence.as_str());
    match verdict {
        Verdict::NothingMissing => {
            // A fault of the velocity may be present.
            let faults = findings.iter().map(|fault| format!("{} ", fault.sentence));
            let nothing = "Nothing is missing: the residual of the twin does not follow the motion. It is measurement noise.";
            faults.chain([nothing.to_owned()]).collect()
        }
        Verdict::NotEvaluated => "Nothing was evaluated.".to_owned(),
        Verdict::UnknownRemains if findings.is_empty() => {
            format!("Part of the mismatch has no named cause. {remains}")
        }
        Verdict::Explained | Verdict::UnknownRemains => {
            // A fault of the recordings, or else the finding with the largest effort.
            let larger = |a: &&Finding, b: &&Finding| a.effort_rms.total_cmp(&b.effort_rms);
            let fault = findings.iter().find(|finding| finding.is_slip());
            let first = fault.or_else(|| findings.iter().rev().max_by(larger));
            let part = first.filter(|_| has_changed).and_then(look_at);
            let part = part.map_or_else(String::new, |part| format!(" Look there first: {part}"));
            let first = first.map_or("", |finding| finding.sentence.as_str());
            let more = match findings.len() {
                0 | 1 => String::new(),
                2 => " One more effect was found.".to_owned(),
                n => format!(" {} more effects were found.", n - 1),
            };
            let remains = if remains.is_empty() {
                String::new()
            } else {
                format!(" {remains}")
            };
            format!("{first}{part}{more}{proof}{remains}")
        }
    }
}

/// Returns the effect of the correction on the error on held-out recordings: over all joints, and at the joint where
/// it increases most.
fn proof(joints: &[String], [before, after]: [&[f64]; 2]) -> String {
    let left = error_left(before, after);
    if !left.is_finite() {
        return String::new();
    }
    let all = if left < 0.01 {
        " On recordings that were not fitted the error (RMS) falls to less than 1 % of what it was."
            .to_owned()
    } else if left < UNCHANGED {
        format!(
            " On recordings that were not fitted the error (RMS) falls to {:.0} % of what it was.",
            100.0 * left
        )
    } else {
        " On recordings that were not fitted the correction makes no difference.".to_owned()
    };
    let times = |j: usize| after[j] / before[j];
    let worse = (0..joints.len()).filter(|&j| times(j) * UNCHANGED > 1.0);
    let worst = worse.max_by(|&a, &b| times(a).total_cmp(&times(b)));
    let worse = worst.map_or_else(String::new, |j| {
        format!(
            " But at joint {} it rises to {:.0} % of what it was.",
            joints[j],
            100.0 * times(j)
        )
    });
    all + &worse
}
