//! How much evidence an effect needs, and how much of the residual it must explain.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{Against, CoordinateKind, Layer};

use crate::data::column::Column;
use crate::data::effective_samples;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::fit::least_squares::Products;
use crate::physics::active::{Active, Hypothesis, TimeKind};
use crate::select::explanation::Explanation;
use crate::select::trial::LEAST_DIAGONAL;

/// Evidence that an effect needs \[nats\]: odds of 3000 to 1.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const LEAST_EVIDENCE: f64 = 8.0;
/// Variance that an effect must explain at some joint, over the variance then left there: differentiation and filters
/// may leave an error of less.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const LEAST_SIZE: f64 = 0.12;
/// The same for an effect that acts once.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SIZE_OF_INTERVAL: f64 = 0.03;
/// Evidence that an effect that acts once needs \[nats\].
/// Tuned: by hand, on no recorded seeds; not swept.
const INTERVAL_EVIDENCE: f64 = 40.0;
/// The same as [`LEAST_SIZE`] beside a curve in the same joint, or for an effect that acts once beside any curve: the
/// effect may only correct the curve.
/// Tuned: by hand, on no recorded seeds; not swept.
const LEAST_SIZE_BESIDE_CURVE: f64 = 3.0;
/// The same for an effort that is recorded otherwise from some time on.
/// Tuned: by hand on nine arms of which one was zeroed anew and one had its gain set; the effects that it must not take the
/// place of are those of `python3 tests/proof/first_sight.py TAUSCOPE OUT --seed 42 --beside friction,bodies`.
const LEAST_SIZE_OF_JUMP: f64 = 3.0;
/// Evidence beyond which the correlation of noise does not matter, each row counted as one independent sample \[nats\].
/// Tuned: by hand, on no recorded seeds; not swept.
const OVERWHELMING: f64 = 40.0;
/// An overwhelming explanation also divides the variance at some joint by this.
/// Tuned: by hand, on no recorded seeds; not swept.
const FAIR_SHARE: f64 = 1.8;
/// The same if it has more effects that act once: these cannot follow slow noise all the time.
/// Tuned: by hand, on no recorded seeds; not swept.
const FAIR_SHARE_FOR_A_WHILE: f64 = 1.3;
/// The same if it has more curves: these can follow any slow noise.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const FAIR_SHARE_OF_CURVE: f64 = 3.0;
/// Rivals nearer than this cannot be told apart \[nats\]: odds of 150 to 1.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const TIE: f64 = 5.0;
/// The same as a share of the evidence.
/// Tuned: by hand, on no recorded seeds; not swept.
const TIE_SHARE: f64 = 0.01;
/// Proposals of a round that are refined before one is taken.
/// Tuned: by hand, for what it costs in time; not swept.
pub const REFINED: usize = 3;
/// Gain of evidence that an exchange needs \[nats\].
/// Tuned: by hand, on no recorded seeds; not swept.
pub const LEAST_GAIN: f64 = 0.5;

/// Evidence that a curve needs \[nats\].
/// Tuned: by hand, on no recorded seeds; not swept.
pub const CURVE_EVIDENCE: f64 = 25.0;
/// A curve must divide the variance at its joint by this.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const CURVE_SIZE: f64 = 1.35;
/// What explains less than this share of what larger effects do may only patch an error of those.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const PATCH: f64 = 0.02;
/// An effect that contains a simpler one must be ahead of it by this \[nats\].
/// Statistical: ln 20, odds of twenty to one.
pub const MORE_THAN_SIMPLE: f64 = 3.0;

/// Least variance that a division is made by \[N² m²\].
/// Resolution: guards a division by zero; far below the noise of any effort.
pub const LEAST_VARIANCE: f64 = 1e-16;
/// Added to the diagonal of the scaled normal equations, which is 1.
/// Resolution: guards the inverse of dependent columns.
const RIDGE: f64 = 1e-9;

/// Effective samples per row, by joint, with which the evidence for an effect in `with` is counted. One that begins or ends
/// within the session makes the noise look more correlated than it is, until it is part of the explanation.
pub fn independent(problem: &Problem, with: &Fit, hypothesis: Hypothesis) -> Vec<f64> {
    match hypothesis.time_kind() {
        TimeKind::Once | TimeKind::Step => effective_samples::at_least(problem, &with.residual),
        TimeKind::Always | TimeKind::EveryRecording => problem.effective_samples.clone(),
    }
}

/// How far a rival may be behind \[nats\] and still not be told from an effect with this evidence.
pub fn tie(evidence: f64) -> f64 {
    TIE.max(TIE_SHARE * evidence)
}

/// Whether an explanation is better than another, however correlated the noise is: it has `OVERWHELMING` evidence if
/// each row counts as one independent sample, and takes a fair share of the variance at some joint.
pub fn overwhelming(explanation: &Explanation, other: &Explanation) -> bool {
    let white = vec![1.0; other.fit.variance.len()];
    let more = |is: &dyn Fn(&Active) -> bool| {
        let count = |e: &Explanation| e.fit.actives.iter().filter(|a| is(a)).count();
        count(explanation) > count(other)
    };
    let share = if more(&|a| a.curve.is_some()) {
        FAIR_SHARE_OF_CURVE
    } else if more(&|a| a.hypothesis.time_kind() == TimeKind::Once) {
        FAIR_SHARE_FOR_A_WHILE
    } else {
        FAIR_SHARE
    };
    let less = |(with, without): (&f64, &f64)| *without > share * with;
    explanation.ahead_of(other, &white) > OVERWHELMING
        && explanation
            .fit
            .variance
            .iter()
            .zip(&other.fit.variance)
            .any(less)
}

/// By effect, Wald's statistic: the square of its factors in units of their covariance, as if the residual were white.
pub fn wald(problem: &Problem, fit: &Fit) -> Vec<f64> {
    let jacobian = fit.jacobian(problem);
    let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
    let products = Products::new(problem, &columns, &fit.residual, None);
    let (normal, _) = products.normal(&fit.variance, &vec![0.0; columns.len()]);
    let p = columns.len();
    let scale: Vec<f64> = (0..p)
        .map(|a| normal[(a, a)].max(LEAST_DIAGONAL).sqrt())
        .collect();
    let mut scaled = DMatrix::from_fn(p, p, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
    for a in 0..p {
        scaled[(a, a)] += RIDGE;
    }
    let Some(inverse) = scaled.try_inverse() else {
        return vec![0.0; fit.actives.len()];
    };
    let mut first = 0;
    fit.actives
        .iter()
        .map(|active| {
            let index: Vec<usize> = (0..active.coordinates.len())
                .filter(|&c| matches!(active.kind(c), CoordinateKind::Factor { .. }))
                .map(|c| first + c)
                .collect();
            let theta = DVector::from_iterator(
                index.len(),
                index
                    .iter()
                    .map(|&a| active.coordinates[a - first] * scale[a]),
            );
            first += active.coordinates.len();
            let own = DMatrix::from_fn(index.len(), index.len(), |a, b| {
                inverse[(index[a], index[b])]
            });
            own.try_inverse()
                .map_or(0.0, |own| (own * &theta).dot(&theta))
        })
        .collect()
}

/// Evidence \[nats\] and size that an effect needs beside the effects of `fit`. The size is the variance that it
/// explains at some joint over the variance then left there.
pub fn needs(hypothesis: Hypothesis, fit: &Fit) -> (f64, f64) {
    let joint = hypothesis.only_joint();
    let once = hypothesis.time_kind() == TimeKind::Once;
    let goes_with = |a: &Active| hypothesis.is_plain_friction() && a.is_friction_curve();
    let curve = |a: &Active| {
        a.curve.is_some() && (once || a.hypothesis.only_joint() == joint) && !goes_with(a)
    };
    let beside_curve = (once || joint.is_some()) && fit.actives.iter().any(curve);
    // An offset or a gain that jumps follows slow noise, and half of what depends on something else.
    let follows_noise =
        hypothesis.time_kind() == TimeKind::Step && hypothesis.effect.layer == Layer::Record;
    let (evidence, size) = if once {
        (INTERVAL_EVIDENCE, LEAST_SIZE_OF_INTERVAL)
    } else if follows_noise {
        (INTERVAL_EVIDENCE, LEAST_SIZE_OF_JUMP)
    } else {
        (LEAST_EVIDENCE, LEAST_SIZE)
    };
    if beside_curve {
        return (evidence, LEAST_SIZE_BESIDE_CURVE);
    }
    (evidence, size)
}

/// Up to this ratio of variance to white noise, the residual of a joint counts as noise alone.
/// Tuned: by hand, on no recorded seeds; not swept.
const QUIET_RATIO: f64 = 1.5;
/// From this ratio on, the residual counts as an effect that the library lacks.
/// Tuned: by hand, on no recorded seeds; not swept.
const LOUD_RATIO: f64 = 4.0;

/// Whether `with` explains enough more than `without` at some joint, as a share of the variance that it leaves there.
/// The share is `least` where that variance is white noise, and rises to `loud` where it is far above: an effect that
/// the library lacks may then imitate a small one.
pub fn matters(problem: &Problem, with: &Fit, without: &Fit, least: f64, loud: f64) -> bool {
    (0..problem.joints).any(|j| {
        let ratio = with.variance[j]
            / (problem.white_noise[j] * problem.white_noise[j]).max(LEAST_VARIANCE);
        let share = ((ratio - QUIET_RATIO) / (LOUD_RATIO - QUIET_RATIO)).clamp(0.0, 1.0);
        let needed = least.max(least + share * (loud - least));
        without.variance[j] - with.variance[j] >= needed * with.variance[j]
    })
}

/// The joints at which `fit` leaves clearly more variance than `better`.
pub fn worse_joints(fit: &Fit, better: &Fit) -> Vec<usize> {
    let worse = |&j: &usize| fit.variance[j] > (1.0 + LEAST_SIZE) * better.variance[j];
    (0..fit.variance.len()).filter(worse).collect()
}

/// Whether a curve in the joint already contains what a hypothesis would explain: friction that is not plain, or a
/// function of position. Beside the curve the hypothesis could take any size, which the curve would cancel.
pub fn is_drawn_already(fit: &Fit, hypothesis: Hypothesis) -> bool {
    let bends = hypothesis.effect.traits.drawn_over == Some(Against::Velocity);
    let joint = hypothesis.only_joint();
    let draws = |active: &Active| {
        active.curve.as_ref().is_some_and(|curve| {
            let own = Some(curve.of_joint) == joint && active.hypothesis.only_joint() == joint;
            let of_position = curve.against == Against::Position && !curve.by_direction;
            own && if of_position {
                hypothesis.is_of_position()
            } else {
                bends && active.is_friction_curve()
            }
        })
    };
    fit.actives.iter().any(draws)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};
    use crate::select::propose::Base;

    /// Explanations with one effect and with none, on data with this viscous friction in the first joint \[N m s/rad\].
    fn with(effect: &str, viscous: f64) -> (Problem, Explanation, Explanation) {
        let problem = problem_with(1, |_, qd, effort| effort[0] += viscous * qd[0]);
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        let proposal = base.propose_at(at_joint(effect, 0), &[0.0]).unwrap();
        let fit = nothing.with(&problem, proposal.active).refined(&problem);
        let with = Explanation {
            fit,
            penalties: vec![proposal.penalty],
        };
        let without = Explanation {
            fit: nothing,
            penalties: Vec::new(),
        };
        (problem, with, without)
    }

    #[test]
    fn an_effect_that_is_there_has_evidence_and_one_that_is_not_has_less_than_none() {
        let (problem, with, without) = with("viscous_friction", 0.8);
        let evidence = with.ahead_of(&without, &problem.effective_samples);
        assert!(evidence > 10.0 * LEAST_EVIDENCE, "{evidence}");
        assert!(overwhelming(&with, &without));
        assert!(matters(
            &problem,
            &with.fit,
            &without.fit,
            LEAST_SIZE,
            LEAST_SIZE
        ));
        assert_eq!(worse_joints(&without.fit, &with.fit), [0]);
        let (problem, with, without) = self::with("torque_bias", 0.0);
        assert!(with.ahead_of(&without, &problem.effective_samples) < 0.0);
        assert!(!overwhelming(&with, &without));
        assert!(!matters(
            &problem,
            &with.fit,
            &without.fit,
            LEAST_SIZE,
            LEAST_SIZE
        ));
    }

    #[test]
    fn evidence_for_one_is_evidence_against_the_other_and_correlation_makes_it_less() {
        let (problem, with, without) = with("viscous_friction", 0.8);
        let white = vec![1.0; problem.joints];
        let (there, back) = (
            with.ahead_of(&without, &white),
            without.ahead_of(&with, &white),
        );
        assert!((there + back).abs() < 1e-6);
        assert!(with.ahead_of(&without, &[0.2, 0.2]) < 0.3 * there);
    }

    #[test]
    fn rivals_of_a_strong_effect_tie_within_a_share_of_its_evidence() {
        assert!((tie(10.0) - TIE).abs() < 1e-12);
        assert!((tie(1e5) - TIE_SHARE * 1e5).abs() < 1e-9);
    }

    #[test]
    fn what_lasts_for_an_interval_needs_more_evidence_than_what_lasts() {
        let problem = problem_with(2, |_, _, _| {});
        let nothing = Fit::new(&problem, Vec::new());
        let (lasting, _) = needs(at_joint("viscous_friction", 0), &nothing);
        let (once, _) = needs(at_joint("external_push", 0), &nothing);
        assert!((lasting - LEAST_EVIDENCE).abs() < 1e-12);
        assert!((once - INTERVAL_EVIDENCE).abs() < 1e-12);
    }

    #[test]
    fn walds_test_is_the_square_of_a_number_over_its_deviation() {
        let (problem, strong, _) = with("viscous_friction", 0.8);
        let (weak_problem, weak, _) = with("viscous_friction", 0.2);
        let (strong, weak) = (
            wald(&problem, &strong.fit)[0],
            wald(&weak_problem, &weak.fit)[0],
        );
        // Four times the friction under the same noise: sixteen times the square.
        assert!((strong / weak / 16.0 - 1.0).abs() < 0.3, "{strong} {weak}");
    }
}
