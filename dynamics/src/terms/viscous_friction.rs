//! Friction in proportion to speed.

use super::{Effect, MotionSample, Parameter, Role, Term, words};

pub(super) static EFFECT: Effect = Effect {
    name: "viscous_friction",
    parameters: &[Parameter {
        name: "viscous_nms_per_rad",
        role: Role::Factor,
        minimum: 0.0,
    }],
    build: |joint, values| {
        Box::new(ViscousFriction {
            joint,
            values: [values[0]],
        })
    },
};

/// Effort Fv qd (Siciliano et al., *Robotics*, 2009, equation 7.42).
#[derive(Debug, Clone, PartialEq)]
struct ViscousFriction {
    joint: usize,
    values: [f64; 1],
}

impl Term for ViscousFriction {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn joint(&self) -> usize {
        self.joint
    }

    fn values(&self) -> &[f64] {
        &self.values
    }

    fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    fn add_effort(&mut self, at: &MotionSample, effort: &mut [f64]) {
        effort[self.joint] += self.values[0] * at.velocity[self.joint];
    }

    fn sentence(&self, joint: &str) -> String {
        let viscous = words::number(self.values[0]);
        format!("Joint {joint} has viscous friction of {viscous} N m s/rad.")
    }
}
