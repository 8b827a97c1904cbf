//! Which parameters a robot may have.

use crate::data::problem::Problem;
use crate::physics::active::Active;
use crate::physics::friction::with_known;

/// Whether a robot may have these parameters, by the effect's own limits.
pub fn plausible(problem: &Problem, active: &Active) -> bool {
    let hypothesis = active.hypothesis;
    let site = hypothesis.place.site(&problem.model);
    let coordinates = with_known(problem, active);
    hypothesis.effect.is_plausible(&site, &coordinates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn friction_that_a_twin_knows_may_grow_from_what_it_was() {
        let mut problem = problem_with(1, |_, _, _| {});
        let step = at_joint("friction_step", 0).with(vec![0.0, 2.0, 5.0]);
        // None comes from nothing.
        assert!(!plausible(&problem, &step));
        problem.known_friction[0].insert("coulomb_friction", 3.0);
        assert!(plausible(&problem, &step));
        // As much as it does from day to day.
        let small = at_joint("friction_step", 0).with(vec![0.0, 0.5, 5.0]);
        assert!(!plausible(&problem, &small));
    }
}
