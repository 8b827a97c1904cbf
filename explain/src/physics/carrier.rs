//! The robots that effects act on: that of the URDF, with the bodies or the tilt that were found.
//!
//! A base that leans, a joint that stands elsewhere and a position that comes late act on a payload as on the arm itself.
//! The product of both, a payload's weight on a base that leans, is in neither of the two efforts by itself. It belongs to
//! the effect on the motion or the mounting where the body is there for good, and to the body where it is there for a
//! while.

use std::sync::{Arc, OnceLock};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Layer, PlaceKind};

use crate::data::problem::Problem;
use crate::physics::act::recorded;
use crate::physics::active::Active;

/// The robots that effects act on next to others.
#[derive(Debug)]
pub struct Carrier {
    /// The robot with the bodies that are there for good.
    loaded: Model,
    /// The robot on its tilted base.
    tilted: Model,
    /// Effort of the first along the recorded motion, once it was asked for.
    recorded: OnceLock<Arc<Vec<f64>>>,
}

impl Carrier {
    /// The robot that an effect acts on.
    pub fn robot(&self, active: &Active) -> &Model {
        if is_for_a_while(active) {
            &self.tilted
        } else {
            &self.loaded
        }
    }

    /// Effort of the robot with its bodies along the motion of all tracks, for `Term::know_recorded`.
    pub fn recorded(&self, problem: &Problem) -> &Arc<Vec<f64>> {
        self.recorded
            .get_or_init(|| recorded(problem, &self.loaded))
    }
}

/// The robots that the effects of `actives` act on; `None` if it is that of the URDF for all.
pub fn carrier(model: &Model, actives: &[Active]) -> Option<Carrier> {
    let (mut loaded, mut tilted) = (model.clone(), model.clone());
    let mut is_other = false;
    for term in (actives.iter().filter(|a| alters_robot(a))).map(|a| a.term(model)) {
        if let Some((link, inertia)) = term.inertia() {
            loaded.attach(link, inertia);
            is_other = true;
        } else {
            is_other |= term.alter(&mut tilted);
        }
    }
    is_other.then(|| Carrier {
        loaded,
        tilted,
        recorded: OnceLock::new(),
    })
}

/// Whether an effect acts on whatever else was found: on the bodies that the arm carries, or on the base that leans.
pub fn is_on_carrier(active: &Active) -> bool {
    let effect = active.hypothesis.effect;
    let is_motion = effect.layer == Layer::Body && effect.place != PlaceKind::Link;
    is_motion && effect.bends() || is_for_a_while(active)
}

fn is_for_a_while(active: &Active) -> bool {
    active.hypothesis.is_body() && !active.hypothesis.lasts()
}

/// Whether an effect may change the robot that others act on, for good.
pub fn alters_robot(active: &Active) -> bool {
    active.hypothesis.effect.layer == Layer::Body
        && active.hypothesis.lasts()
        && !active.hypothesis.is_torque_scale()
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::effect;
    use tauscope_dynamics::{Inertia, Model};

    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, model, problem, recording};
    use crate::physics::active::{Hypothesis, Whereabouts};

    fn at_tool(model: &Model, name: &str) -> Hypothesis {
        Hypothesis {
            effect: effect(name).unwrap(),
            place: Whereabouts {
                link: model.tool_link(),
                ..Whereabouts::default()
            },
        }
    }

    /// Of a robot that carries two kilograms with a zero that is off, both effects together leave nothing. Each by itself,
    /// added up, leaves their product.
    #[test]
    fn a_payload_stands_where_the_joint_stands() {
        let plain = model();
        let tool = plain.tool_link();
        let body = Inertia::from_parameters([2.0, 0.2, 0.0, 0.2, 0.05, 0.0, 0.0, 0.05, 0.0, 0.05]);
        let mut real = plain.clone();
        real.attach(tool, body);
        real.shift_zero(1, 0.1);
        let recordings = [1, 2].map(|seed| recording(&real, seed, |_, _, _| {}));
        let problem = problem(&plain, &recordings);
        let payload = at_tool(&plain, "payload").with(body.parameters().to_vec());
        let offset = at_joint("joint_zero_offset", 1).with(vec![0.1]);
        let square = |fit: &Fit| fit.squares.iter().sum::<f64>();
        let bare = square(&Fit::new(&problem, Vec::new()));
        let alone = Fit::new(&problem, vec![offset.clone()]);
        let together = Fit::new(&problem, vec![payload.clone(), offset.clone()]);
        assert!(square(&together) < 1e-6 * bare, "{}", square(&together));
        // Also where the rest is taken from a fit without the payload.
        let added = Fit::beside(
            &problem,
            vec![offset.clone(), payload.clone()],
            Some(&alone),
        );
        assert!(square(&added) < 1e-6 * bare, "{}", square(&added));
        // And where one joint's recording is transformed.
        let gain = at_joint("torque_gain", 0).with(vec![0.0]);
        let through = Fit::beside(&problem, vec![payload, offset, gain], Some(&together));
        assert!(square(&through) < 1e-6 * bare, "{}", square(&through));
    }

    /// A payload that is there all the time is the same on a base that leans, whether it is there for good or for a while.
    #[test]
    fn a_payload_for_a_while_leans_with_the_base() {
        let plain = model();
        let recordings = [1, 2].map(|seed| recording(&plain, seed, |_, _, _| {}));
        let problem = problem(&plain, &recordings);
        let body = [2.0, 0.2, 0.0, 0.2, 0.05, 0.0, 0.0, 0.05, 0.0, 0.05];
        let for_a_while = [&body[..], &[-1.0, 1e6]].concat();
        let tilt = Hypothesis {
            effect: effect("base_tilt").unwrap(),
            place: Whereabouts::default(),
        };
        let residual = |name: &str, coordinates: Vec<f64>| {
            let payload = at_tool(&plain, name).with(coordinates);
            Fit::new(&problem, vec![tilt.with(vec![0.2, -0.3]), payload]).residual
        };
        let lasting = residual("payload", body.to_vec());
        let passing = residual("payload_pickup", for_a_while);
        for (lasting, passing) in lasting.iter().zip(&passing) {
            assert!((lasting - passing).abs() < 1e-6, "{lasting} {passing}");
        }
    }
}
