//! The verdict of an explanation.

use tauscope_dynamics::terms::UNKNOWN;

use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::report::holdout::Proof;
use crate::report::schema::{Finding, Verdict};

/// An explanation does not carry over at a joint if its error on held-out recordings is this many times that on fitted
/// ones.
/// Tuned: by hand, on no recorded seeds; not swept.
const WORSE: f64 = 2.0;
/// The error on held-out recordings must also be this many times the measurement's white noise.
/// Tuned: by hand, on no recorded seeds; not swept.
const ABOVE_NOISE: f64 = 3.0;

/// The joints at which the error on held-out recordings is much larger than on fitted ones.
pub fn left_elsewhere(proof: &Proof, noise_floor: &[f64]) -> Vec<usize> {
    let more = |&j: &usize| {
        let [there, here] = [proof.within[0][j], proof.within[1][j]];
        there > WORSE * here && there > ABOVE_NOISE * noise_floor[j]
    };
    (0..noise_floor.len()).filter(more).collect()
}

/// The verdict, given the joints at which the explanation does not carry over.
pub fn verdict(found: &Fit, findings: &[Finding], left_elsewhere: &[usize]) -> Verdict {
    let described = |active: &Active| active.hypothesis.said() == UNKNOWN.name;
    let described = found.actives.iter().any(described);
    if described || !left_elsewhere.is_empty() {
        Verdict::UnknownRemains
    } else if findings.is_empty() {
        Verdict::NothingMissing
    } else {
        Verdict::Explained
    }
}

/// A note on the joints at which the explanation does not carry over, if there are any. `names` are those of all joints.
pub fn note(proof: &Proof, joints: &[usize], names: &[String], unit: &str) -> Option<String> {
    let each = joints.iter().map(|&joint| {
        let [there, here] = [proof.within[0][joint], proof.within[1][joint]];
        let (name, times) = (&names[joint], there / here);
        format!("{there:.3} {unit} at joint {name} ({times:.1} times)")
    });
    let each: Vec<String> = each.collect();
    (!each.is_empty()).then(|| {
        format!(
            "The error on the held-out recordings is larger than on the fitted ones: {}. Either something acts on the held-out \
             recordings only, or the correction does not carry over to them.",
            each.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn proof(held_out: f64, fitted: f64) -> Proof {
        Proof {
            before: vec![held_out],
            after: vec![held_out],
            within: [vec![held_out], vec![fitted]],
            predictions: Vec::new(),
            pictures: Vec::new(),
        }
    }

    #[test]
    fn what_is_left_elsewhere_alone_is_told_from_noise_and_from_what_is_left_everywhere() {
        let noise = [0.1];
        assert!(left_elsewhere(&proof(0.1, 0.1), &noise).is_empty());
        // As much as where it was fitted, and little beside the noise.
        assert!(left_elsewhere(&proof(1.0, 0.9), &noise).is_empty());
        assert!(left_elsewhere(&proof(0.25, 0.1), &noise).is_empty());
        let elsewhere = proof(1.0, 0.2);
        let joints = left_elsewhere(&elsewhere, &noise);
        assert_eq!(joints, [0]);
        let note = note(&elsewhere, &joints, &["lift".to_owned()], "N m").unwrap();
        assert!(
            note.contains("1.000 N m at joint lift (5.0 times)"),
            "{note}"
        );
        // Without the efforts of those held out nothing is said of them.
        assert!(left_elsewhere(&proof(f64::NAN, 0.2), &noise).is_empty());
    }
}
