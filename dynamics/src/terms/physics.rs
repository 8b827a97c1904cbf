//! Chain of all terms of a robot, from the rigid-body effort to the recorded effort.

use super::{Layer, MotionSample, Term, TermError, TermSpec};
use crate::Model;

/// Terms in the order of application: bodies, joints, recording.
#[derive(Debug, Default)]
pub struct Physics {
    terms: Vec<Box<dyn Term>>,
    /// Number of terms of [`Layer::Body`].
    bodies: usize,
    transmitted: Vec<f64>,
}

impl Physics {
    /// Creates the chain for a robot of `joint_count` joints. Sorts the terms by layer.
    pub fn new(mut terms: Vec<Box<dyn Term>>, joint_count: usize) -> Self {
        terms.sort_by_key(|term| term.effect().layer);
        let before = |layer: Layer| terms.iter().filter(|t| t.effect().layer < layer).count();
        Self {
            bodies: before(Layer::Joint),
            terms,
            transmitted: vec![0.0; joint_count],
        }
    }

    /// Builds the terms of `specs` for a robot. Terms that change the model (a payload, a tilted base) are built in
    /// list order, each for the model as changed so far. Other body terms (an elastic joint) are built for the final
    /// model. The efforts do not depend on the order of the list.
    ///
    /// # Errors
    /// If a term cannot be built.
    pub fn build(specs: &[TermSpec], model: &Model) -> Result<Self, TermError> {
        let mut altered = model.clone();
        let mut terms = Vec::with_capacity(specs.len());
        let mut unaltering = Vec::new();
        for (i, spec) in specs.iter().enumerate() {
            let term = spec.build(&altered)?;
            if !term.alter(&mut altered) {
                unaltering.push(i);
            }
            terms.push(term);
        }
        // A body term in front of a payload in the list must act on the robot with the payload, too.
        for i in unaltering {
            if terms[i].effect().layer == Layer::Body {
                terms[i] = specs[i].build(&altered)?;
            }
        }
        Ok(Self::new(terms, model.dof()))
    }

    /// The terms in the order of application.
    pub fn terms(&self) -> &[Box<dyn Term>] {
        &self.terms
    }

    /// The terms of [`Layer::Body`], which depend on the robot.
    pub fn bodies(&self) -> &[Box<dyn Term>] {
        &self.terms[..self.bodies]
    }

    /// Whether there are no terms.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Clears the state before a new recording or after a gap.
    pub fn reset(&mut self) {
        for term in &mut self.terms {
            term.reset();
        }
    }

    /// Transforms `effort` in place from the rigid-body effort to the recorded effort \[N m or N\]. Call it once per
    /// sample. Computes [`MotionSample::transmitted`] itself and ignores that of `at`. Does not allocate.
    pub fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        self.act_bodies(at, effort);
        self.act_joints(at, effort);
    }

    /// First half of [`Physics::act`]: from the rigid-body effort to the effort that the gears transmit.
    pub fn act_bodies(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let at = with(&mut self.transmitted, at, effort);
        for term in &mut self.terms[..self.bodies] {
            term.act(&at, effort);
        }
    }

    /// Second half of [`Physics::act`]: from the transmitted to the recorded effort.
    pub fn act_joints(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let at = with(&mut self.transmitted, at, effort);
        for term in &mut self.terms[self.bodies..] {
            term.act(&at, effort);
        }
    }
}

/// The instant with `effort` as the transmitted effort, which is stored in `memory`.
fn with<'a>(memory: &'a mut [f64], at: &MotionSample<'a>, effort: &[f64]) -> MotionSample<'a> {
    memory.copy_from_slice(effort);
    MotionSample {
        transmitted: memory,
        ..*at
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion};
    use super::*;
    use crate::{Data, rnea};

    fn spec(effect: &str, parameters: &[(&str, f64)]) -> TermSpec {
        let named = |&(name, value): &(&str, f64)| (name.to_owned(), value);
        TermSpec {
            effect: effect.to_owned(),
            parameters: parameters.iter().map(named).collect(),
            ..TermSpec::default()
        }
    }

    #[test]
    fn terms_of_bodies_know_of_each_other() {
        let robot = TwoJoints::new();
        let payload = [
            ("mass_kg", 2.0),
            ("com_x_m", 0.1),
            ("com_y_m", 0.0),
            ("com_z_m", 0.2),
        ];
        let specs = [
            spec("payload", &payload),
            spec("base_tilt", &[("roll_rad", 0.4), ("pitch_rad", -0.3)]),
        ];
        let mut altered = robot.model.clone();
        for spec in &specs {
            assert!(spec.build(&robot.model).unwrap().alter(&mut altered));
        }
        let mut data = Data::new(&altered);
        for at in motion(&robot.model, 20) {
            let expected = rnea(
                &altered,
                &mut data,
                &at.position,
                &at.velocity,
                &at.acceleration,
            );
            for order in [[0, 1], [1, 0]] {
                let specs = order.map(|i| specs[i].clone());
                let mut physics = Physics::build(&specs, &robot.model).unwrap();
                let mut effort = at.transmitted;
                physics.act(&at.view(), &mut effort);
                for (a, b) in effort.iter().zip(expected) {
                    assert!((a - b).abs() < 1e-9, "{a} {b}");
                }
            }
        }
    }

    #[test]
    fn an_elastic_joint_bears_the_payload_wherever_it_stands() {
        let robot = TwoJoints::new();
        let payload = [
            ("mass_kg", 2.0),
            ("com_x_m", 0.1),
            ("com_y_m", 0.0),
            ("com_z_m", 0.2),
        ];
        let elastic = [("stiffness_nm_per_rad", 300.0), ("rotor_inertia_kgm2", 0.1)];
        let mut elastic = spec("joint_elasticity", &elastic);
        elastic.joint = Some("one".to_owned());
        let specs = [elastic, spec("payload", &payload)];
        let backward = [specs[1].clone(), specs[0].clone()];
        let mut forward = Physics::build(&specs, &robot.model).unwrap();
        let mut backward = Physics::build(&backward, &robot.model).unwrap();
        let mut apart = Physics::new(
            specs
                .iter()
                .map(|s| s.build(&robot.model).unwrap())
                .collect(),
            2,
        );
        let mut differs = false;
        for at in motion(&robot.model, 20) {
            let mut efforts = [at.transmitted; 3];
            forward.act(&at.view(), &mut efforts[0]);
            backward.act(&at.view(), &mut efforts[1]);
            apart.act(&at.view(), &mut efforts[2]);
            assert!((efforts[0][0] - efforts[1][0]).abs() < 1e-9);
            differs |= (efforts[0][0] - efforts[2][0]).abs() > 0.1;
        }
        assert!(differs, "a soft joint sags under a payload");
    }
}
