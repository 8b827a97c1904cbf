//! Whether effort that is flat at a limit was cut off by the sensor.

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;

/// The required effort is clearly above the limit if it exceeds it by this many times the noise.
/// Statistical: Gaussian noise goes beyond four standard deviations once in 16 000 samples.
const CLEAR: f64 = 4.0;
/// At least this many samples must be clearly above it, so that no single spike decides.
/// Resolution: of a spike behind the filters of drives.
const LEAST_SAMPLES: usize = 10;

/// Whether the recorded motion requires more effort than the limit of a `torque_saturation`.
///
/// The drive exerted the effort that the recorded motion requires. If that is clearly more than the limit, the sensor
/// clipped the recorded effort. If instead the drive saturated, the motion slowed down, and the effort at the limit is
/// enough for it.
pub fn is_clipped(problem: &Problem, fit: &Fit, saturation: &Active) -> bool {
    let joint = saturation.hypothesis.place.joint;
    let clear = saturation.coordinates[0] + CLEAR * problem.white_noise[joint];
    let required = fit.efforts(problem).mechanical.iter().flat_map(|track| {
        let of_joint = track.iter().skip(joint).step_by(problem.joints);
        of_joint.filter(|effort| effort.abs() > clear)
    });
    required.count() >= LEAST_SAMPLES
}
