//! Application of remedies to recordings, and of their inverses to predictions.

use tauscope_dynamics::JointKind;

use super::{Remedy, Slip, velocity};
use crate::read::input::Input;
use crate::read::recording::Recording;

impl Input {
    /// Applies remedies to the recordings, or to their declared units and constants.
    pub fn mend(&mut self, slips: &[Slip]) {
        for slip in slips {
            let n = self.model.dof();
            let recordings = self.fit.iter_mut().chain(&mut self.holdout);
            match slip.remedy {
                Remedy::GravitySubtracted => self.model.set_gravity([0.0; 3]),
                Remedy::IsCurrent | Remedy::IsOfRating => "A".clone_into(&mut self.effort_unit),
                Remedy::IsTorque => "Nm".clone_into(&mut self.effort_unit),
                Remedy::ConstantsScaled(factor) => {
                    for constant in self.torque_constants_nm_per_a.iter_mut().flatten() {
                        *constant *= factor;
                    }
                }
                Remedy::ConstantsWrong => self.torque_constants_nm_per_a = None,
                Remedy::Degrees => {
                    let turning = self.model.joints().iter();
                    let turning: Vec<usize> = (turning.enumerate())
                        .filter(|(_, joint)| joint.kind != JointKind::Prismatic)
                        .map(|(j, _)| j)
                        .collect();
                    recordings.for_each(|recording| in_radians(recording, &turning, n));
                }
                _ => recordings.for_each(|recording| slip.remedy.mend(recording, n)),
            }
        }
    }
}

/// Converts positions from degrees to rad; velocities too, if they are the change of these positions.
fn in_radians(recording: &mut Recording, turning: &[usize], n: usize) {
    let in_degrees = velocity::slope(recording, turning, n).is_some_and(|slope| slope > 0.5);
    let to_rad = std::f64::consts::PI / 180.0;
    for &joint in turning {
        scale(&mut recording.position, joint, n, to_rad);
        if in_degrees {
            scale(&mut recording.velocity, joint, n, to_rad);
        }
    }
}

/// Multiplies a joint's column.
pub(super) fn scale(rows: &mut [f64], joint: usize, n: usize, factor: f64) {
    rows.iter_mut()
        .skip(joint)
        .step_by(n)
        .for_each(|x| *x *= factor);
}

impl Remedy {
    pub(super) fn mend(&self, recording: &mut Recording, n: usize) {
        match *self {
            Self::Swapped(a, b) => recording
                .effort
                .chunks_exact_mut(n)
                .for_each(|row| row.swap(a, b)),
            Self::NamesSwapped(a, b) => {
                for rows in [
                    &mut recording.position,
                    &mut recording.velocity,
                    &mut recording.effort,
                ] {
                    rows.chunks_exact_mut(n).for_each(|row| row.swap(a, b));
                }
            }
            Self::EffortTurned(j) => scale(&mut recording.effort, j, n, -1.0),
            // A constant effort is no measurement, and is left out.
            Self::EffortWithoutSign(j) => scale(&mut recording.effort, j, n, 0.0),
            Self::PositionTurned(j) | Self::JointTurned(j) => {
                scale(&mut recording.position, j, n, -1.0);
                scale(&mut recording.velocity, j, n, -1.0);
                if matches!(self, Self::JointTurned(_)) {
                    scale(&mut recording.effort, j, n, -1.0);
                }
            }
            Self::EffortScaled(factor) => {
                recording.effort.iter_mut().for_each(|x| *x /= factor);
            }
            Self::Velocity(Some(joint), factor) => {
                scale(&mut recording.velocity, joint, n, 1.0 / factor);
            }
            Self::Velocity(None, factor) => {
                recording.velocity.iter_mut().for_each(|x| *x /= factor);
            }
            _ => {}
        }
    }

    /// Converts efforts of corrected recordings back to the recorded columns: rows of `n` numbers.
    pub fn undo(&self, rows: &mut [f64], n: usize) {
        match *self {
            Self::Swapped(a, b) | Self::NamesSwapped(a, b) => {
                rows.chunks_exact_mut(n).for_each(|row| row.swap(a, b));
            }
            Self::EffortTurned(j) | Self::JointTurned(j) => scale(rows, j, n, -1.0),
            Self::EffortScaled(factor) => rows.iter_mut().for_each(|x| *x *= factor),
            _ => {}
        }
    }
}
