//! Expansion of the rigid body's effort about a motion, for a deviation of one joint's link.

use crate::{Data, Model, rnea};

/// Step of the difference quotients in position \[rad or m\]; the effort is quadratic in velocity and linear in
/// acceleration.
/// Physical: the error of a central difference, some 1e-6 of the effort, is below that of any recording.
const POSITION_STEP: f64 = 1e-3;
/// Values per joint and sample: the effort, its first and second derivative by position, and those by velocity and
/// acceleration.
const ORDERS: usize = 5;

/// Effort of the rigid body at all joints along a motion, to second order in a deviation of one joint's position and
/// to first order in those of its velocity and acceleration. It is computed once per motion and given to each of many
/// trial transmissions by [`super::Term::expand`], which saves inverse dynamics.
#[derive(Debug, Clone)]
pub struct Expansion {
    joint: usize,
    joints: usize,
    numbers: Vec<f64>,
}

impl Expansion {
    /// Creates an expansion for deviations of `joint`, with an empty motion.
    pub fn new(model: &Model, joint: usize) -> Self {
        Self {
            joint,
            joints: model.dof(),
            numbers: Vec::new(),
        }
    }

    /// Adds the next sample of the motion: position, velocity and acceleration of all joints.
    ///
    /// # Panics
    /// If a slice does not have one value per joint of `model`.
    pub fn push(&mut self, model: &Model, data: &mut Data, q: &[f64], qd: &[f64], qdd: &[f64]) {
        let j = self.joint;
        let (mut moved_q, mut moved_qd, mut moved_qdd) = (q.to_vec(), qd.to_vec(), qdd.to_vec());
        let here = rnea(model, data, q, qd, qdd).to_vec();
        let h = POSITION_STEP;
        moved_q[j] = q[j] + h;
        let above = rnea(model, data, &moved_q, qd, qdd).to_vec();
        moved_q[j] = q[j] - h;
        let below = rnea(model, data, &moved_q, qd, qdd).to_vec();
        moved_qd[j] = qd[j] + 1.0;
        let faster = rnea(model, data, q, &moved_qd, qdd).to_vec();
        moved_qd[j] = qd[j] - 1.0;
        let slower = rnea(model, data, q, &moved_qd, qdd).to_vec();
        moved_qdd[j] += 1.0;
        let pulled = rnea(model, data, q, qd, &moved_qdd).to_vec();
        for i in 0..self.joints {
            self.numbers.extend([
                here[i],
                (above[i] - below[i]) / (2.0 * h),
                (above[i] - 2.0 * here[i] + below[i]) / (h * h),
                0.5 * (faster[i] - slower[i]),
                pulled[i] - here[i],
            ]);
        }
    }

    /// Writes the effort at sample `k` for this deviation of the joint \[rad, rad/s, rad/s² or m\].
    pub(super) fn effort(&self, k: usize, [q, qd, qdd]: [f64; 3], into: &mut [f64]) {
        let row = &self.numbers[k * ORDERS * self.joints..(k + 1) * ORDERS * self.joints];
        for (into, orders) in into.iter_mut().zip(row.as_chunks::<ORDERS>().0) {
            let [here, by_q, by_qq, by_qd, by_qdd] = orders;
            *into = here + (by_q + 0.5 * by_qq * q) * q + by_qd * qd + by_qdd * qdd;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::tests::{TwoJoints, motion, run};
    use super::super::{effect, tests::Instant};
    use super::*;

    fn along(robot: &TwoJoints, motion: &[Instant]) -> Expansion {
        let mut data = Data::new(&robot.model);
        let mut all = Expansion::new(&robot.model, 0);
        for at in motion {
            all.push(
                &robot.model,
                &mut data,
                &at.position,
                &at.velocity,
                &at.acceleration,
            );
        }
        all
    }

    #[test]
    fn near_the_motion_it_is_the_rigid_body() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 50);
        let all = along(&robot, &motion);
        let mut data = Data::new(&robot.model);
        let [q, qd, qdd] = [0.05, -0.4, 3.0];
        for (k, at) in motion.iter().enumerate() {
            let exact = rnea(
                &robot.model,
                &mut data,
                &[at.position[0] + q, at.position[1]],
                &[at.velocity[0] + qd, at.velocity[1]],
                &[at.acceleration[0] + qdd, at.acceleration[1]],
            );
            let mut near = [0.0; 2];
            all.effort(k, [q, qd, qdd], &mut near);
            for (near, exact) in near.iter().zip(exact) {
                assert!((near - exact).abs() < 0.02, "{near} for {exact}");
            }
        }
    }

    #[test]
    fn a_term_that_was_given_one_costs_the_same() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 300);
        let all = Arc::new(along(&robot, &motion));
        for (name, shape) in [("joint_elasticity", 800.0), ("backlash", 0.004)] {
            let build = || (effect(name).unwrap().build)(&robot.site(), &[0.2, shape]);
            let alone = run(&mut *build(), &motion);
            let mut expanded = build();
            expanded.expand(&all);
            let expanded = run(&mut *expanded, &motion);
            let largest = alone
                .iter()
                .flatten()
                .fold(0.0_f64, |most, e| most.max(e.abs()));
            for (a, b) in alone.iter().flatten().zip(expanded.iter().flatten()) {
                assert!((a - b).abs() < 0.01 * largest, "{name}: {a}, expanded {b}");
            }
        }
    }
}
