//! The robot that effects on the motion and the mounting act on: that of the URDF, with the bodies that were found.
//!
//! A base that leans, a joint that stands elsewhere and a position that comes late act on a payload as on the arm itself.
//! The product of both, a payload's weight on a base that leans, is in neither of the two efforts by itself.

use std::sync::{Arc, OnceLock};

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::Layer;

use crate::data::problem::Problem;
use crate::physics::act::recorded;
use crate::physics::active::Active;

/// A robot with bodies on it.
#[derive(Debug)]
pub struct Carrier {
    /// The robot.
    pub model: Model,
    /// What it costs along the recorded motion, once that was asked for.
    recorded: OnceLock<Arc<Vec<f64>>>,
}

impl Carrier {
    /// What it costs along the motion of all tracks, for `Term::know_recorded`.
    pub fn recorded(&self, problem: &Problem) -> &Arc<Vec<f64>> {
        self.recorded.get_or_init(|| recorded(problem, &self.model))
    }
}

/// The robot with the bodies of `actives` that are there for good; `None` without any.
pub fn carrier(model: &Model, actives: &[Active]) -> Option<Carrier> {
    let bodies = actives.iter().filter(|active| is_carried(active));
    let inertias = bodies.filter_map(|active| active.term(model).inertia());
    let model = inertias.fold(None, |carrier, (link, inertia)| {
        let mut carrier = carrier.unwrap_or_else(|| model.clone());
        carrier.attach(link, inertia);
        Some(carrier)
    })?;
    Some(Carrier {
        model,
        recorded: OnceLock::new(),
    })
}

/// Whether an effect acts on whatever the arm carries.
pub fn is_on_carrier(active: &Active) -> bool {
    active.hypothesis.effect.layer == Layer::Body && active.hypothesis.effect.traits.bends
}

/// Whether an effect may be a body that is there for good.
pub fn is_carried(active: &Active) -> bool {
    active.hypothesis.effect.layer == Layer::Body
        && active.hypothesis.lasts()
        && !is_on_carrier(active)
        && !active.hypothesis.is_torque_scale()
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::Inertia;
    use tauscope_dynamics::terms::effect;

    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, model, problem, recording};
    use crate::physics::active::{Hypothesis, Whereabouts};

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
        let payload = Hypothesis {
            effect: effect("payload").unwrap(),
            place: Whereabouts {
                link: tool,
                ..Whereabouts::default()
            },
        };
        let payload = payload.with(body.parameters().to_vec());
        let offset = at_joint("joint_zero_offset", 1).with(vec![0.1]);
        let square = |fit: &Fit| fit.squares.iter().sum::<f64>();
        let bare = square(&Fit::new(&problem, Vec::new()));
        let alone = Fit::new(&problem, vec![offset.clone()]);
        let together = Fit::new(&problem, vec![payload.clone(), offset.clone()]);
        assert!(square(&together) < 1e-6 * bare, "{}", square(&together));
        // Also where the rest is taken from a fit without the payload.
        let added = alone.with(&problem, payload);
        assert!(square(&added) < 1e-6 * bare, "{}", square(&added));
        // And where one joint's recording is transformed.
        let gain = at_joint("torque_gain", 0).with(vec![0.0]);
        let through = together.with(&problem, gain);
        assert!(square(&through) < 1e-6 * bare, "{}", square(&through));
    }
}
