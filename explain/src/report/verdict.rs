//! The verdict of an explanation.

use tauscope_dynamics::terms::UNKNOWN;

use crate::report::schema::{Finding, Remaining, Verdict};

/// Returns the verdict, given the remaining residual. If the `twin_is_topic`, a remaining residual next to findings
/// does not decide: another simulation has delays and friction of its own, which are not physics of the arm. A fault
/// of the recorded velocity does not decide, because velocities are computed from the positions.
pub fn verdict(findings: &[Finding], remaining: &[Remaining], twin_is_topic: bool) -> Verdict {
    let findings: Vec<&Finding> = findings.iter().filter(|f| !f.is_of_velocity()).collect();
    let is_described = |f: &&Finding| f.effect == UNKNOWN.name && !f.is_body_off();
    let described = findings.iter().any(is_described);
    let decides = !twin_is_topic || findings.is_empty();
    let of_the_arm = !remaining.is_empty() && decides;
    if described || of_the_arm {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::finding;
    use crate::report::schema::SHARE_OF_CARRIED;
    use serde_json::Value;

    #[test]
    fn a_body_that_is_a_little_lighter_than_the_twins_is_no_unknown() {
        for (share, said) in [(0.05, Verdict::Explained), (0.9, Verdict::UnknownRemains)] {
            let mut lighter = finding(UNKNOWN.name);
            let share = (SHARE_OF_CARRIED.to_owned(), Value::from(share));
            lighter.parameters.extend([share]);
            let found = verdict(&[lighter], &[], false);
            assert_eq!(found, said);
        }
    }

    #[test]
    fn beside_another_simulation_a_remainder_beside_findings_does_not_decide() {
        let findings = [finding("coulomb_friction")];
        let remaining = [Remaining {
            joint: "elbow".to_owned(),
            rms: 2.0,
            holdout_rms: Some(3.0),
            noise: 0.1,
            sentence: String::new(),
        }];
        for (twin_is_topic, said) in [(true, Verdict::Explained), (false, Verdict::UnknownRemains)]
        {
            assert_eq!(verdict(&findings, &remaining, twin_is_topic), said);
        }
    }
}
