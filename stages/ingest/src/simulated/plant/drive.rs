//! What the drives are told.

use nalgebra::DMatrix;

/// Effort by velocity error \[N m s/rad\].
#[derive(Debug, Clone, Copy)]
pub(in super::super) enum Damping<'a> {
    /// Each joint's by its own.
    Joints(&'a [f64]),
    /// Each joint's by all: symmetric, and it takes energy off every motion or none.
    Coupled(&'a DMatrix<f64>),
}

impl Damping<'_> {
    /// Of joint `j` by its own velocity.
    pub fn of(&self, j: usize) -> f64 {
        match self {
            Self::Joints(damping) => damping[j],
            Self::Coupled(damping) => damping[(j, j)],
        }
    }
}

/// Velocities of the motors: the place of each joint's among velocities, and those.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motors<'a>(pub &'a [usize], pub &'a [f64]);

impl Motors<'_> {
    fn velocity(&self, j: usize) -> f64 {
        self.1[self.0[j]]
    }
}

/// What the drives are told: an effort, and a velocity to keep to. Their own loop is fast, so it acts
/// on the velocity at the end of a step.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Drive<'a> {
    /// \[N m\]
    pub effort_nm: &'a [f64],
    pub damping: Damping<'a>,
    /// The velocity to keep to \[rad/s\].
    pub velocity: &'a [f64],
    /// The most a drive can give, either way \[N m\].
    pub limit_nm: &'a [f64],
}

impl Drive<'_> {
    /// The effort of joint `j`, and whether it is all that the drive can give.
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
