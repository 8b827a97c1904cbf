//! Whether effort that is flat at a limit was cut off by the sensor.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;

/// The motion requires clearly more than the limit where it does so by this many times the noise,
const CLEAR: f64 = 4.0;
/// and in at least so many samples, so that no single spike decides.
const LEAST_SAMPLES: usize = 10;

/// Whether the recorded motion requires more effort than the limit of a `torque_saturation`.
///
/// The effort that a motion requires was there, or the arm would have moved otherwise. So a motion that goes on as if
/// the effort rose above the limit tells of a sensor that clips. A drive that saturates shows in the motion itself, for
/// which the effort at the limit is then enough.
pub fn is_clipped(problem: &Problem, fit: &Fit, saturation: &Active) -> bool {
    let joint = saturation.hypothesis.place.joint;
    let clear = saturation.coordinates[0] + CLEAR * problem.white_noise[joint];
    let required = fit.efforts(problem).mechanical.iter().flat_map(|track| {
        let of_joint = track.iter().skip(joint).step_by(problem.joints);
        of_joint.filter(|effort| effort.abs() > clear)
    });
    required.count() >= LEAST_SAMPLES
}
