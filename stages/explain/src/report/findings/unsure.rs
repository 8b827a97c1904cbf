//! Bodies that another one may cancel.

use crate::data::problem::Problem;
use crate::fit::interval::half_width_95;
use crate::physics::active::Active;

use super::doubt::DOUBTED;

/// Confidence of a body whose mass may be nothing by the noise, at most.
/// Physical: an arm that turns about vertical axes alone hardly shows a mass; one that lifts does.
const UNSURE_BODY: f64 = 0.85;

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
    use crate::fixture::problem_with;
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
}
