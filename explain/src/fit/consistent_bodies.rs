//! Projection of estimated bodies onto physically consistent ones.
//!
//! An inertia that the motion hardly excites may be estimated with the wrong sign. A body whose pseudo-inertia is not
//! positive definite (Wensing, Kim and Slotine, "Linear Matrix Inequalities for Physically Consistent Inertial
//! Parameter Identification", 2018) is replaced by a consistent one close to it.

use tauscope_dynamics::kinematic_tree::reach_m;
use tauscope_dynamics::{Inertia, Model};

use crate::physics::active::{Active, BODY};

/// Minimum standard deviation of a corrected body's mass distribution in each direction \[m\].
/// Physical: that of a compact motor or a gripper's finger.
const LEAST_SPREAD_M: f64 = 0.015;
/// Fraction of its URDF inertia that a link keeps if its estimated mass is not positive.
/// Resolution: far below the masses that recordings distinguish from zero.
const LEAST_SHARE: f64 = 0.1;
/// Distance of a centre of mass from its link's frame that is plausible on an arm of any size \[m\].
/// Physical: tools are shorter.
const LONG_TOOL_M: f64 = 1.0;

/// Replaces bodies that are not physically consistent. Returns whether it replaced any.
pub fn make_consistent(model: &Model, actives: &mut [Active]) -> bool {
    let mut odd = false;
    for active in actives {
        if let Some((body, of_urdf)) = active.body(model) {
            let least_m2 = LEAST_SPREAD_M * LEAST_SPREAD_M;
            let mut nearest = body.nearest_consistent(least_m2);
            // A motion that excites only the mass leaves the centre of mass undetermined. Later steps of the fit do
            // not bring a centre back that has left the arm's reach.
            let from_link_m = nearest.com_m().iter().map(|x| x * x).sum::<f64>().sqrt();
            let farthest_m = reach_m(model, active.hypothesis.place.link).max(LONG_TOOL_M);
            if of_urdf.is_none() && from_link_m > farthest_m {
                let mass = nearest.mass_kg();
                // A variance σ² in each direction gives the principal moments I = 2 m σ².
                let moment = 2.0 * mass * least_m2;
                nearest = Inertia::new(mass, [0.0; 3], [moment, 0.0, 0.0, moment, 0.0, moment]);
            }
            if let Some(link) = of_urdf
                && nearest.mass_kg() <= 0.0
            {
                let little = link.parameters().map(|parameter| LEAST_SHARE * parameter);
                nearest = Inertia::from_parameters(little);
            }
            if nearest != body {
                odd = true;
                let own = of_urdf.map_or(nearest, |link| nearest - link);
                active.coordinates[..BODY].copy_from_slice(&own.parameters());
            }
        }
    }
    odd
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::physics::library;

    const ARM: &str = include_str!("../../../tests/data/demo_arm.urdf");

    #[test]
    fn what_is_no_body_becomes_one() {
        let model = Model::from_urdf(ARM).unwrap();
        let all = library::hypotheses(&model, true, &BTreeSet::new());
        let payload = all.iter().find(|h| h.effect.name == "payload").unwrap();
        let impossible = Inertia::new(1.0, [0.1; 3], [-0.1, 0.0, 0.0, 0.1, 0.0, 0.1]);
        let link = library::unnamed_bodies(&model, &BTreeSet::new())[2];
        let without_mass = model.links()[link.place.link].inertia;
        let without_mass = without_mass.parameters().map(|x| -1.5 * x);
        for odd in [
            payload.with(impossible.parameters().to_vec()),
            link.with(without_mass.to_vec()),
        ] {
            let mut actives = [odd];
            assert!(make_consistent(&model, &mut actives));
            assert!(!make_consistent(&model, &mut actives));
            let (body, _) = actives[0].body(&model).unwrap();
            assert!(body.mass_kg() > 0.0 && body.nearest_consistent(0.0) == body);
        }
    }
}
