//! What bodies cost near a motion, as one joint's link leaves it.

use crate::{Data, Model, rnea};

/// Steps of the difference quotients: position \[rad or m\]; effort is quadratic in velocity and linear in acceleration.
const POSITION_STEP: f64 = 1e-3;
/// Numbers per joint and sample: the effort, by position once and twice, by velocity, by acceleration.
const ORDERS: usize = 5;

/// The rigid body's effort at all joints along a motion, to second order in a deviation of one joint's position and to
/// first order in those of its velocity and acceleration. Whoever tries many transmissions on one motion computes it
/// once and gives it to each with [`super::Term::expand`]: that spares inverse dynamics.
#[derive(Debug, Clone)]
pub struct Expansion {
    joint: usize,
    joints: usize,
    numbers: Vec<f64>,
}

impl Expansion {
    /// For deviations of `joint` of a robot, at first along no motion.
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
    /// If a slice is not one number per joint of `model`.
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

    /// Writes the effort at sample `k` with the joint off by these \[rad, rad/s, rad/s² or m\].
    pub(super) fn effort(&self, k: usize, [q, qd, qdd]: [f64; 3], into: &mut [f64]) {
        let row = &self.numbers[k * ORDERS * self.joints..(k + 1) * ORDERS * self.joints];
        for (into, orders) in into.iter_mut().zip(row.as_chunks::<ORDERS>().0) {
            let [here, by_q, by_qq, by_qd, by_qdd] = orders;
            *into = here + (by_q + 0.5 * by_qq * q) * q + by_qd * qd + by_qdd * qdd;
        }
    }
}
