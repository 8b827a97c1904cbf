//! Findings that bodies which are off may have made: a body that another one may cancel, friction that differs by direction.

use crate::data::problem::Problem;
use crate::fit::interval::half_width_95;
use crate::physics::active::{Active, Hypothesis};

use super::doubt::DOUBTED;

/// Confidence of a body whose mass may be nothing by the noise, at most.
/// Physical: an arm that turns about vertical axes alone hardly shows a mass; one that lifts does.
const UNSURE_BODY: f64 = 0.85;

/// Confidence of what is told as the same both ways, at most.
/// Tuned: in `tests/proof/reliability.py`, seeds 6001 to 6300, all five that are told so were the same both ways, and all 21
/// that are told to differ did.
pub const ALIKE: f64 = 0.85;

/// What is told in the place of an effect of two directions whose intervals overlap: the simpler effect, with the mean of
/// both, and with a standard deviation that leaves room for both. Weight that is not told pulls the one direction up and
/// the other down, so their errors add up. The error of a torque constant does not count: both directions share it.
pub fn alike(problem: &Problem, active: &Active, deviations: &[f64]) -> Option<(Active, Vec<f64>)> {
    let Hypothesis { effect, place } = active.hypothesis;
    let simpler = effect.simpler?;
    let is_of_directions = simpler.numbers.len() == 2 && effect.parameters.len() == 2;
    let (Some(&[one, other]), &[of_one, of_other]) =
        (active.parameters().first_chunk(), deviations.first_chunk()?)
    else {
        return None;
    };
    let (apart, half) = ((one - other).abs(), half_width_95(problem));
    let overlap = apart < half * (of_one + of_other);
    (is_of_directions && overlap).then(|| {
        let effect = simpler.effect;
        let plain = Hypothesis { effect, place }.with(vec![0.5 * (one + other)]);
        let deviation = of_one.max(of_other) + 0.5 * apart / half;
        (plain, vec![deviation])
    })
}

/// The highest confidence that a finding may have: less where its mass may as well be nothing, given the standard deviations
/// of its parameters, of all errors and `by_noise` alone.
pub fn surest(problem: &Problem, active: &Active, deviations: &[f64], by_noise: &[f64]) -> f64 {
    let effect = active.hypothesis.effect;
    let mass = effect.parameters.first();
    let is_mass = mass.is_some_and(|parameter| parameter.name.ends_with("mass_kg"));
    let value = active.parameters().first().copied().unwrap_or(0.0);
    let is_nothing = |deviations: &[f64]| {
        let half = deviations
            .first()
            .map(|deviation| half_width_95(problem) * deviation);
        is_mass && half.is_some_and(|half| value.abs() <= half)
    };
    if is_nothing(by_noise) {
        UNSURE_BODY
    // It is as likely that nothing is there and the URDF's bodies are off.
    } else if is_nothing(deviations) {
        DOUBTED
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::body_prior::tests::carried;
    use crate::fixture::{at_joint, problem_with};
    use tauscope_dynamics::Inertia;

    #[test]
    fn a_mass_that_may_be_nothing_is_less_sure() {
        let problem = problem_with(1, |_, _, _| {});
        let inertia = [2e-3, 0.0, 0.0, 2e-3, 0.0, 2e-3];
        let payload = &carried(Inertia::new(1.0, [0.0; 3], inertia))[0];
        let (sure, vague) = (&[0.1; 10], &[0.6; 10]);
        assert!(surest(&problem, payload, sure, sure) >= 1.0);
        assert!(surest(&problem, payload, vague, vague) <= UNSURE_BODY);
        // The noise says that it is there, and bodies that are off may say the same.
        assert!(surest(&problem, payload, vague, sure) <= DOUBTED);
    }

    #[test]
    fn friction_that_may_be_the_same_both_ways_is_told_as_plain_friction_that_holds_both() {
        let problem = problem_with(1, |_, _, _| {});
        let alike = |name: &str, values: &[f64], deviation: f64| {
            let active = at_joint(name, 1).with(values.to_vec());
            alike(
                &problem,
                &active,
                &vec![deviation; active.parameters().len()],
            )
        };
        let (plain, deviation) = alike("asymmetric_coulomb", &[0.5, 0.4], 0.05).unwrap();
        assert_eq!(plain.hypothesis, at_joint("coulomb_friction", 1));
        assert!((plain.parameters()[0] - 0.45).abs() < 1e-9);
        let half = half_width_95(&problem) * deviation[0];
        assert!(half > 0.05 + 1.96 * 0.05, "{half}");
        assert!(alike("asymmetric_coulomb", &[0.5, 0.2], 0.05).is_none());
        // What changes once, or with the speed, is no matter of directions.
        assert!(alike("friction_step", &[0.5, 0.4, 9.0], 0.05).is_none());
        assert!(alike("viscous_friction", &[0.5], 0.05).is_none());
    }
}
