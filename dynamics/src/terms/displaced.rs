//! A robot with a joint whose true position differs from the recorded one.

use std::sync::Arc;

use super::MotionSample;
use crate::{Data, Model, rnea};

/// Difference between the effort of the true motion and that of the recorded motion.
#[derive(Debug)]
pub(super) struct Displaced {
    joint: usize,
    model: Model,
    data: Data,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
    /// Effort of the recorded motion, sample by sample, if it was supplied.
    recorded: Option<Arc<Vec<f64>>>,
    sample: usize,
}

impl Displaced {
    /// Creates it for a robot whose joint `joint` is displaced.
    pub fn new(model: &Model, joint: usize) -> Self {
        let zero = vec![0.0; model.dof()];
        Self {
            joint,
            model: model.clone(),
            data: Data::new(model),
            position: zero.clone(),
            velocity: zero.clone(),
            acceleration: zero,
            recorded: None,
            sample: 0,
        }
    }

    /// As [`super::Term::know_recorded`].
    pub fn know_recorded(&mut self, efforts: &Arc<Vec<f64>>) {
        self.recorded = Some(Arc::clone(efforts));
        self.sample = 0;
    }

    /// Skips a sample at which the joint is at its recorded position.
    pub fn skip(&mut self) {
        self.sample += 1;
    }

    /// Adds to `effort` the difference at the next sample, with the joint at this position, velocity and acceleration
    /// \[rad, rad/s, rad/s² or m\]. Does not allocate.
    ///
    /// # Panics
    /// If the supplied efforts end before this sample.
    pub fn act(&mut self, at: &MotionSample<'_>, [q, qd, qdd]: [f64; 3], effort: &mut [f64]) {
        self.position.copy_from_slice(at.position);
        self.velocity.copy_from_slice(at.velocity);
        self.acceleration.copy_from_slice(at.acceleration);
        self.position[self.joint] = q;
        self.velocity[self.joint] = qd;
        self.acceleration[self.joint] = qdd;
        let (model, data) = (&self.model, &mut self.data);
        let truly = rnea(
            model,
            data,
            &self.position,
            &self.velocity,
            &self.acceleration,
        );
        for (effort, truly) in effort.iter_mut().zip(truly) {
            *effort += truly;
        }
        let row = self.sample * effort.len()..(self.sample + 1) * effort.len();
        let recorded = match &self.recorded {
            Some(known) => &known[row],
            None => rnea(model, data, at.position, at.velocity, at.acceleration),
        };
        for (effort, recorded) in effort.iter_mut().zip(recorded) {
            *effort -= recorded;
        }
        self.sample += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::super::effect;
    use super::super::tests::{TwoJoints, motion, run};
    use super::*;

    #[test]
    fn what_is_known_of_the_recorded_motion_need_not_be_computed() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 100);
        let mut data = Data::new(&robot.model);
        let mut recorded = Vec::new();
        for at in &motion {
            let (q, qd, qdd) = (&at.position, &at.velocity, &at.acceleration);
            recorded.extend_from_slice(rnea(&robot.model, &mut data, q, qd, qdd));
        }
        let recorded = Arc::new(recorded);
        let cases: [(&str, &[f64]); 5] = [
            ("joint_zero_offset", &[0.1]),
            ("joint_zero_offset_in_recording", &[0.1, 0.2, 0.5]),
            ("joint_zero_slip", &[0.1, -0.1, 0.5]),
            ("encoder_eccentricity", &[0.02, -0.01, 1.0]),
            ("late_position", &[0.02]),
        ];
        for (name, values) in cases {
            let build = || (effect(name).unwrap().build)(&robot.site(), values);
            let alone = run(&mut *build(), &motion);
            let mut knowing = build();
            knowing.know_recorded(&recorded);
            assert_eq!(alone, run(&mut *knowing, &motion), "{name}");
        }
    }
}
