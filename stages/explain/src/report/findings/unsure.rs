//! Bodies that another one may cancel.

use crate::data::problem::Problem;
use crate::fit::interval::half_width_95;
use crate::physics::active::Active;

/// Confidence of a body whose mass may be nothing, at most.
/// Physical: an arm that turns about vertical axes alone hardly shows a mass; one that lifts does.
const UNSURE_BODY: f64 = 0.85;

/// The highest confidence that a finding may have: less where its mass may as well be nothing, given the standard deviations
/// of its parameters.
pub fn surest(problem: &Problem, active: &Active, deviations: &[f64]) -> f64 {
    let effect = active.hypothesis.effect;
    let mass = effect.parameters.first();
    let is_mass = mass.is_some_and(|parameter| parameter.name.ends_with("mass_kg"));
    let value = active.parameters().first().copied().unwrap_or(0.0);
    if is_mass && value.abs() <= half_width_95(problem) * deviations[0] {
        UNSURE_BODY
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
        assert!(surest(&problem, payload, &[0.1; 10]) >= 1.0);
        assert!(surest(&problem, payload, &[0.6; 10]) <= UNSURE_BODY);
    }
}
