//! The confidence of a finding: the probability that its effect and place are right, up to what no recording can tell
//! apart.

use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};

/// Log-odds of a finding that explains as much as is left beside it, and has no evidence against it.
/// Tuned: with the four below, as [`confidence`] says.
const BASE: f64 = 0.932;
/// Change of the log-odds with the logarithm of what the finding explains over what is left beside it.
/// Tuned: as [`BASE`].
const PER_LOG_OVER_REST: f64 = 0.669;
/// Change for each nat of evidence below zero.
/// Tuned: as [`BASE`].
const PER_NAT_BELOW: f64 = 0.043;
/// Change for a function of position or a scale, which something that the library lacks is often mistaken for.
/// Tuned: as [`BASE`].
const IMITATED: f64 = -2.192;
/// Change for a function of position beside another one in its joint: together they may only draw a curve.
/// Tuned: as [`BASE`].
const BESIDE_ANOTHER: f64 = -3.104;
/// A smaller ratio of explained to remaining squares counts as this, so that the logarithm stays finite.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_OVER_REST: f64 = 0.01;
/// The highest confidence. The cases of the regression are too few for a higher one.
/// Tuned: by hand, on no recorded seeds; not swept.
const SUREST: f64 = 0.999;

/// The quantities that the confidence of a finding is computed from.
#[derive(Debug, Clone, Copy)]
pub struct Grounds {
    /// What the finding explains over what is left beside it: squares, at the joint where that is most.
    pub over_rest: f64,
    /// Evidence for it rather than for leaving it out, each row counted as a fraction of an independent sample \[nats\].
    evidence: f64,
    /// Whether it is a function of its joint's position, or scales all effort of the joint.
    imitated: bool,
    /// Whether another finding is a function of the same joint's position, too.
    beside_another: bool,
}

impl Grounds {
    /// Those of a piece of an explanation; `less` is what is left of it without the piece.
    pub fn of(found: &Fit, less: &Fit, active: &Active, evidence: f64) -> Self {
        let own = active.hypothesis;
        let over = |(less, found): (&f64, &f64)| less / found - 1.0;
        let over_rest = less.variance.iter().zip(&found.variance).map(over);
        let another = |other: Hypothesis| {
            other != own && other.is_of_position() && other.place.joint == own.place.joint
        };
        let mut others = found.actives.iter().map(|other| other.hypothesis);
        Self {
            over_rest: over_rest.fold(0.0, f64::max),
            evidence,
            imitated: own.is_of_position() || own.effect.traits.is_scale,
            beside_another: own.is_of_position() && others.any(another),
        }
    }
}

/// The probability that a finding is right, by a logistic regression of right or wrong on its grounds.
///
/// Tuned: `tests/proof/reliability.py TAUSCOPE OUT --first 6001 --cases 300 --table --half even --fit` prints the five numbers;
/// docs/proof.md shows what they come to on the odd seeds. The odd seeds alone give 0.81, 0.51, 0.025, -1.1 and -2.2.
pub fn confidence(grounds: Grounds) -> f64 {
    let Grounds {
        over_rest,
        evidence,
        imitated,
        beside_another,
    } = grounds;
    let log_odds = BASE
        + PER_LOG_OVER_REST * over_rest.max(LEAST_OVER_REST).ln()
        + PER_NAT_BELOW * evidence.min(0.0)
        + if imitated { IMITATED } else { 0.0 }
        + if beside_another { BESIDE_ANOTHER } else { 0.0 };
    (1.0 / (1.0 + (-log_odds).exp())).min(SUREST)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: Grounds = Grounds {
        over_rest: 30.0,
        evidence: 50.0,
        imitated: false,
        beside_another: false,
    };

    #[test]
    fn what_explains_more_of_what_is_left_is_surer_and_never_certain() {
        let at = |over_rest: f64| confidence(Grounds { over_rest, ..PLAIN });
        assert!(at(0.0) < 0.5 && at(1.0) > at(0.2) && at(30.0) > 0.9);
        assert!(at(1e9) <= SUREST && at(0.0) > 0.0);
    }

    #[test]
    fn evidence_that_correlated_noise_leaves_nothing_of_makes_less_sure() {
        let at = |evidence: f64| confidence(Grounds { evidence, ..PLAIN });
        assert!(at(-30.0) < at(-5.0) && at(-5.0) < at(0.0));
        assert!((at(0.0) - at(500.0)).abs() < 1e-12);
    }

    #[test]
    fn a_spring_is_less_sure_than_friction_and_two_in_one_joint_are_doubtful() {
        let spring = Grounds {
            imitated: true,
            ..PLAIN
        };
        let second = Grounds {
            beside_another: true,
            ..spring
        };
        assert!(confidence(spring) < confidence(PLAIN));
        assert!(confidence(second) < 0.5);
    }
}
