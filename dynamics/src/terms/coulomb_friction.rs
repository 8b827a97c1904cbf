//! Friction that does not depend on speed.

use super::{Effect, MotionSample, Parameter, Role, Term, words};

/// Over this speed the sign of the velocity is smoothed \[rad/s\].
const SMOOTHING_RAD_S: f64 = 0.002;

pub(super) static EFFECT: Effect = Effect {
    name: "coulomb_friction",
    parameters: &[Parameter {
        name: "coulomb_nm",
        role: Role::Factor,
        minimum: 0.0,
    }],
    build: |joint, values| {
        Box::new(CoulombFriction {
            joint,
            values: [values[0]],
        })
    },
};

/// Effort Fc sgn(qd), with tanh(qd / 0.002 rad/s) for the sign, so that it has a value at rest and a
/// simulation can be integrated through a reversal (Siciliano et al., *Robotics*, 2009, equation 7.42).
#[derive(Debug, Clone, PartialEq)]
struct CoulombFriction {
    joint: usize,
    values: [f64; 1],
}

impl Term for CoulombFriction {
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
        effort[self.joint] += self.values[0] * (at.velocity[self.joint] / SMOOTHING_RAD_S).tanh();
    }

    fn sentence(&self, joint: &str) -> String {
        let coulomb = words::number(self.values[0]);
        format!("Joint {joint} has Coulomb friction of {coulomb} N m.")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_at_a_few_hundredths_and_smooth_through_zero() {
        let mut term = CoulombFriction {
            joint: 0,
            values: [4.0],
        };
        let mut effort = |qd: f64| {
            let at = MotionSample {
                dt_s: 0.0,
                position: &[0.0],
                velocity: &[qd],
                acceleration: &[0.0],
            };
            let mut effort = [0.0];
            term.add_effort(&at, &mut effort);
            effort[0]
        };
        assert!((effort(0.02) - 4.0).abs() < 1e-7);
        assert!((effort(-0.02) + 4.0).abs() < 1e-7);
        assert_eq!(effort(0.0), 0.0);
        assert!((effort(0.002) - 4.0 * 1.0_f64.tanh()).abs() < 1e-12);
    }
}
