//! Commands to the drives.

use nalgebra::DMatrix;

/// Gain from velocity error to effort \[N m s/rad\].
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Damping<'a> {
    /// Decoupled: one gain per joint.
    Joints(&'a [f64]),
    /// Coupled: a symmetric, positive semidefinite matrix.
    Coupled(&'a DMatrix<f64>),
}

impl Damping<'_> {
    /// Returns the gain from the velocity of joint `j` to its own effort.
    pub fn of(&self, j: usize) -> f64 {
        match self {
            Self::Joints(damping) => damping[j],
            Self::Coupled(damping) => damping[(j, j)],
        }
    }
}

/// Velocities of the motors: the index of each joint's motor, and the velocities that it refers to.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motors<'a>(pub &'a [usize], pub &'a [f64]);

impl Motors<'_> {
    fn velocity(&self, j: usize) -> f64 {
        self.1[self.0[j]]
    }
}

/// Command to the drives: an effort and a velocity setpoint. The drives' own velocity loop is fast, so it acts
/// on the velocity at the end of a step.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Drive<'a> {
    /// Effort to which the velocity loop adds \[N m\].
    pub effort_nm: &'a [f64],
    pub damping: Damping<'a>,
    /// Velocity setpoint \[rad/s\].
    pub velocity: &'a [f64],
    /// Effort limit of each drive, in both directions \[N m\].
    pub limit_nm: &'a [f64],
}

impl Drive<'_> {
    /// Returns the effort of joint `j`, and whether the drive's limit saturates it.
    pub(super) fn effort(&self, j: usize, motors: Motors<'_>) -> (f64, bool) {
        let missing = |k: usize| self.velocity[k] - motors.velocity(k);
        let free = match self.damping {
            Damping::Joints(damping) => self.effort_nm[j] + damping[j] * missing(j),
            Damping::Coupled(damping) => {
                let damped = (0..damping.ncols()).map(|k| damping[(j, k)] * missing(k));
                self.effort_nm[j] + damped.sum::<f64>()
            }
        };
        let limit = self.limit_nm[j];
        if free.abs() > limit {
            (limit.copysign(free), true)
        } else {
            (free, false)
        }
    }
}
