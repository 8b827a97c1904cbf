//! The remaining residual of a joint as a finding: no effect or curve that was tried describes it.
//!
//! So programs that read only the findings learn which joint to inspect. The twin stays unchanged, because there is
//! no correction.

use serde_json::Value;
use tauscope_dynamics::terms::UNKNOWN;

use crate::report::schema::{Finding, Remaining, WITHOUT_LAW};

/// Smallest remaining residual of a reported joint, relative to the joint with the largest one, each in units of its
/// noise: an effect at one joint also loads its neighbours.
/// Tuned: by hand, with `tests/proof/first_sight.py` in view, seeds 41 and 42 beside friction and bodies; not swept.
const LEAST_SHARE: f64 = 0.5;
/// Confidence of a finding at the only joint with a remaining residual, and at one of several with similar ones.
/// Tuned: of those reported alone, all 12 were right in `tests/proof/first_sight.py`, seeds 41 and 42, whose faults
/// have no law, and 15 of 27 in `tests/proof/reliability.py`, seeds 6001 to 6300, most of whose effects have one.
const CONFIDENCE_ALONE: f64 = 0.7;
const CONFIDENCE_AMONG: f64 = 0.6;
/// Smallest confidence of an `unknown` that already reports the joint.
/// Statistical: as `verdict::NAMES`.
const TELLS: f64 = 0.5;

/// Returns findings for the joints with the largest remaining residual, unless the findings `said` have an `unknown`
/// at the joint. `in_amperes`: the efforts of the recordings are currents.
pub fn findings(
    remaining: &[Remaining],
    said: &[Finding],
    sliding: &[String],
    in_amperes: bool,
) -> Vec<Finding> {
    let loudest = remaining.iter().map(Remaining::over_noise);
    let least = LEAST_SHARE * loudest.fold(0.0, f64::max);
    let is_told = |remaining: &Remaining| {
        let here = |f: &&Finding| f.joint.as_ref() == Some(&remaining.joint);
        let mut here = said.iter().filter(here);
        here.any(|f| f.effect == UNKNOWN.name && f.confidence >= TELLS)
    };
    let loud = |remaining: &&Remaining| remaining.over_noise() >= least;
    let all: Vec<&Remaining> = remaining.iter().filter(loud).collect();
    let confidence = if all.len() == 1 {
        CONFIDENCE_ALONE
    } else {
        CONFIDENCE_AMONG
    };
    let untold = all.into_iter().filter(|remaining| !is_told(remaining));
    let of = |remaining: &Remaining| Finding {
        in_amperes,
        slides: sliding.contains(&remaining.joint),
        ..finding(remaining, confidence)
    };
    untold.map(of).collect()
}

fn finding(remaining: &Remaining, confidence: f64) -> Finding {
    let parameters = [
        ("kind", Value::from(WITHOUT_LAW)),
        ("remaining_nm", Value::from(remaining.largest_rms())),
        ("over_noise", Value::from(remaining.over_noise())),
    ];
    Finding {
        effect: UNKNOWN.name.to_owned(),
        joint: Some(remaining.joint.clone()),
        parameters: parameters
            .map(|(name, value)| (name.to_owned(), value))
            .into(),
        confidence,
        effort_rms: remaining.largest_rms(),
        sentence: format!(
            "Joint {} has a residual that no effect or curve describes. {}",
            remaining.joint, remaining.sentence
        ),
        ..Finding::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    fn remaining(joint: &str, rms: f64) -> Remaining {
        Remaining {
            joint: joint.to_owned(),
            rms,
            holdout_rms: None,
            noise: 0.1,
            sentence: format!("{rms} N m remain at {joint}."),
        }
    }

    fn told(all: &[(&str, f64)], said: &[Finding]) -> Vec<(String, f64)> {
        let remaining: Vec<Remaining> = (all.iter())
            .map(|(joint, rms)| remaining(joint, *rms))
            .collect();
        let findings = findings(&remaining, said, &[], false);
        findings
            .into_iter()
            .map(|f| (f.joint.unwrap_or_default(), f.confidence))
            .collect()
    }

    #[test]
    fn the_joint_that_leaves_most_is_told_and_those_that_leave_about_as_much_with_less_confidence()
    {
        assert_eq!(told(&[], &[]), []);
        let one = [("elbow".to_owned(), CONFIDENCE_ALONE)];
        assert_eq!(told(&[("lift", 1.0), ("elbow", 4.0)], &[]), one);
        let both = ["lift", "elbow"].map(|joint| (joint.to_owned(), CONFIDENCE_AMONG));
        assert_eq!(told(&[("lift", 3.0), ("elbow", 4.0)], &[]), both);
    }

    #[test]
    fn a_joint_with_an_unknown_already_is_not_told_twice() {
        let mut curve = fixture::finding("unknown");
        assert_eq!(told(&[("joint1", 4.0)], std::slice::from_ref(&curve)), []);
        // A curve that is probably wrong does not report the joint.
        curve.confidence = 0.3;
        assert_eq!(told(&[("joint1", 4.0)], &[curve]).len(), 1);
    }
}
