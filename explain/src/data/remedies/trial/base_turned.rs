//! Orientation of the base that makes efforts match: a robot on a wall or a ceiling.

use nalgebra::Vector3;

use super::Trial;
use crate::data::remedies::Remedy;

/// Largest relative change of the magnitude of gravity for a turned base, from errors of the bodies in the URDF.
/// Physical: masses of published URDFs are within a tenth of the real ones.
const SAME_GRAVITY: f64 = 0.1;
/// Smallest turn of the base; the search finds smaller ones as a tilt \[rad\].
/// Physical: beyond it a sine is no longer near its angle.
const TURNED_RAD: f64 = 0.5;

impl Trial<'_> {
    /// Returns the best-fitting roll and pitch of the base, if the magnitude of gravity stays the same.
    pub(super) fn base_turned(&self) -> Option<(Remedy, Vec<f64>)> {
        let (found, model_turned) = self.gravity()?;
        let was = Vector3::from(self.problem.model.gravity());
        let same = (found.norm() / was.norm() - 1.0).abs() < SAME_GRAVITY;
        let upright = was.x == 0.0 && was.y == 0.0;
        let turned = found.angle(&was) > TURNED_RAD;
        let remedy = Remedy::BaseTurned(turn_to(&found));
        (same && upright && turned).then_some((remedy, model_turned))
    }

    /// Returns the best-fitting direction of gravity in the base, if it differs from that of the model.
    pub fn turned_gravity(&self) -> Option<Vector3<f64>> {
        let (found, _) = self.gravity()?;
        let was = Vector3::from(self.problem.model.gravity());
        (found.angle(&was) > TURNED_RAD).then(|| found.normalize())
    }

    /// Returns the best-fitting gravity in the base \[m/s²\], and the twin's effort under it.
    fn gravity(&self) -> Option<(Vector3<f64>, Vec<f64>)> {
        let along = |axis: usize| {
            let mut gravity = [0.0; 3];
            gravity[axis] = 1.0;
            self.against_gravity(gravity)
        };
        let columns: Vec<Vec<f64>> = (0..3).map(along).collect();
        let mut weightless = self.problem.rigid().to_vec();
        for (weightless, weight) in weightless
            .iter_mut()
            .zip(self.against_gravity(self.problem.model.gravity()))
        {
            *weightless -= weight;
        }
        let (found, effort) = self.fitted(&weightless, &columns)?;
        Some((Vector3::new(found[0], found[1], found[2]), effort))
    }

    fn against_gravity(&self, gravity: [f64; 3]) -> Vec<f64> {
        let mut model = self.problem.model.clone();
        model.set_gravity(gravity);
        self.efforts(|track| track.rigid_effort(&model, false))
    }
}

/// Returns roll and pitch of a base in which gravity has this direction, with a pitch of at most a quarter turn.
fn turn_to(gravity: &Vector3<f64>) -> [f64; 2] {
    let down = gravity.normalize();
    let sin_roll = (-down.y).clamp(-1.0, 1.0);
    let upside_down = if down.z > 0.0 { -1.0 } else { 1.0 };
    let cos_roll = upside_down * (1.0 - sin_roll * sin_roll).sqrt();
    let pitch = (upside_down * down.x).atan2((upside_down * -down.z).max(0.0));
    [sin_roll.atan2(cos_roll), pitch]
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;

    use super::*;

    #[test]
    fn a_turn_is_told_by_the_gravity_that_the_base_sees() {
        for (roll, pitch) in [(0.7, 0.2), (-1.2, -0.9), (2.5, 0.4), (3.1, -1.0)] {
            let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch);
            let seen = turn.inverse_transform_vector(&Vector3::new(0.0, 0.0, -9.81));
            let [told_roll, told_pitch] = turn_to(&seen);
            assert!((told_roll - roll).abs() < 1e-9 && (told_pitch - pitch).abs() < 1e-9);
        }
    }
}
