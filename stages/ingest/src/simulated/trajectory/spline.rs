//! Motion through given rows along natural cubic splines.

use tauscope_bus::{JointArray, MAX_JOINTS};

use super::Target;

/// The motion; it stays at the last row.
#[derive(Debug)]
pub(in crate::simulated) struct Spline {
    times_s: Vec<f64>,
    positions: Vec<JointArray>,
    /// Second derivatives at the rows.
    curvatures: Vec<JointArray>,
    joint_count: usize,
    at: usize,
}

impl Spline {
    /// Creates a motion through at least one row, with increasing times.
    pub fn new(times_s: Vec<f64>, positions: Vec<JointArray>, joint_count: usize) -> Self {
        let curvatures = natural_curvatures(&times_s, &positions, joint_count);
        Self {
            times_s,
            positions,
            curvatures,
            joint_count,
            at: 0,
        }
    }

    pub fn at(&mut self, t_s: f64) -> Target {
        let last = self.times_s.len() - 1;
        while self.at < last && t_s >= self.times_s[self.at + 1] {
            self.at += 1;
        }
        let mut target = Target::default();
        let k = self.at;
        if k == last || t_s <= self.times_s[0] {
            target.position = self.positions[k];
            return target;
        }
        let h = self.times_s[k + 1] - self.times_s[k];
        let b = (t_s - self.times_s[k]) / h;
        let a = 1.0 - b;
        for j in 0..self.joint_count {
            let (y0, y1) = (self.positions[k][j], self.positions[k + 1][j]);
            let (m0, m1) = (self.curvatures[k][j], self.curvatures[k + 1][j]);
            target.position[j] =
                a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
            target.velocity[j] =
                (y1 - y0) / h + ((1.0 - 3.0 * a * a) * m0 + (3.0 * b * b - 1.0) * m1) * h / 6.0;
            target.acceleration[j] = a * m0 + b * m1;
        }
        target
    }
}

/// Second derivatives of the natural cubic spline: the tridiagonal system of Press et al., Numerical
/// Recipes, section 3.3, solved for all joints at once.
fn natural_curvatures(
    times_s: &[f64],
    positions: &[JointArray],
    joint_count: usize,
) -> Vec<JointArray> {
    let n = positions.len();
    let mut curvatures = vec![[0.0; MAX_JOINTS]; n];
    let mut pivots = vec![0.0; n];
    for i in 1..n.saturating_sub(1) {
        let (before, after) = (times_s[i] - times_s[i - 1], times_s[i + 1] - times_s[i]);
        let share = before / (before + after);
        let pivot = share * pivots[i - 1] + 2.0;
        pivots[i] = (share - 1.0) / pivot;
        for j in 0..joint_count {
            let bend = (positions[i + 1][j] - positions[i][j]) / after
                - (positions[i][j] - positions[i - 1][j]) / before;
            curvatures[i][j] =
                (6.0 * bend / (before + after) - share * curvatures[i - 1][j]) / pivot;
        }
    }
    for i in (1..n.saturating_sub(1)).rev() {
        let after = curvatures[i + 1];
        for (curvature, after) in curvatures[i].iter_mut().zip(after) {
            *curvature += pivots[i] * after;
        }
    }
    curvatures
}
