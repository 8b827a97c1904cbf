//! Reference motion of the controller.

mod fourier;
mod points;
mod spline;
mod teach;

use tauscope_bus::JointArray;

pub(super) use fourier::Fourier;
pub(super) use points::Points;
pub(super) use spline::Spline;
pub(super) use teach::Allowed;

/// Limits of a joint, for the planning of its motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct JointRange {
    pub name: String,
    /// Lower limit \[rad or m\].
    pub lower: f64,
    /// Upper limit \[rad or m\].
    pub upper: f64,
    /// Velocity limit \[rad/s or m/s\].
    pub velocity: f64,
    /// Effort limit \[N m or N\].
    pub effort: f64,
}

impl JointRange {
    pub fn middle(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Half the width of the range.
    pub fn half(&self) -> f64 {
        0.5 * (self.upper - self.lower)
    }
}

/// Reference of the joints at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Target {
    /// Position \[rad\].
    pub position: JointArray,
    /// Velocity \[rad/s\].
    pub velocity: JointArray,
    /// Acceleration \[rad/s²\].
    pub acceleration: JointArray,
}

/// A motion from its start on, evaluated at times that do not decrease.
#[derive(Debug)]
pub(super) enum Trajectory {
    /// Motion from point to point.
    Points(Box<Points>),
    /// Periodic excitation.
    Fourier(Fourier),
    /// Spline through the rows of a recording.
    Spline(Spline),
}

impl Trajectory {
    /// Returns the reference `t_s` seconds from the start.
    pub fn at(&mut self, t_s: f64) -> Target {
        match self {
            Self::Points(points) => points.at(t_s),
            Self::Fourier(fourier) => fourier.at(t_s),
            Self::Spline(spline) => spline.at(t_s),
        }
    }

    /// Returns the length of a cycle \[s\], for a motion that visits its points repeatedly.
    pub fn cycle_s(&self) -> Option<f64> {
        match self {
            Self::Points(points) => points.cycle_s(),
            _ => None,
        }
    }
}

/// Evaluates the quintic polynomial from 0 to 1 with zero velocity and acceleration at both ends, and its
/// first and second derivative, at `u` from 0 to 1: the path of minimum jerk (Flash and Hogan 1985).
fn quintic(u: f64) -> [f64; 3] {
    let u = u.clamp(0.0, 1.0);
    let (u2, u3) = (u * u, u * u * u);
    [
        u3 * (10.0 - 15.0 * u + 6.0 * u2),
        30.0 * u2 * (1.0 - 2.0 * u + u2),
        60.0 * u * (1.0 - 3.0 * u + 2.0 * u2),
    ]
}

/// Largest value of the quintic's first derivative, at its middle.
/// Physical: 30 u² (1 - u)² at u = ½ is 15/8.
const QUINTIC_PEAK_VELOCITY: f64 = 1.875;
/// Largest value of the quintic's second derivative, 10/√3.
/// Physical: 60 u (1 - 3 u + 2 u²) at u = (3 - √3) / 6 is 10/√3.
const QUINTIC_PEAK_ACCELERATION: f64 = 5.773_502_691_896_258;

#[cfg(test)]
mod tests;
