//! The controller that drives the arm: PD, an integral part, and the nominal model's effort ahead.

use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Data, Model, mass_matrix, rnea};

use super::scenario::ControllerSettings;
use super::trajectory::{JointRange, Target};

/// The integral part may use this share of a joint's effort limit.
const INTEGRAL_SHARE: f64 = 0.5;

/// A controller for one arm. It knows the URDF and the tool, and none of the physics beyond.
#[derive(Debug)]
pub(super) struct Controller {
    model: Model,
    data: Data,
    stiffness: JointArray,
    damping: JointArray,
    integral_gain: JointArray,
    integral: JointArray,
    limit: JointArray,
    /// Its last output \[N m\].
    pub effort_nm: JointArray,
}

impl Controller {
    /// A controller whose gains give each joint the wished frequency and damping where the arm is at
    /// `position`.
    pub fn new(
        model: &Model,
        settings: &ControllerSettings,
        joints: &[JointRange],
        position: &[f64],
    ) -> Self {
        let mut controller = Self {
            model: model.clone(),
            data: Data::new(model),
            stiffness: [0.0; MAX_JOINTS],
            damping: [0.0; MAX_JOINTS],
            integral_gain: [0.0; MAX_JOINTS],
            integral: [0.0; MAX_JOINTS],
            limit: [f64::INFINITY; MAX_JOINTS],
            effort_nm: [0.0; MAX_JOINTS],
        };
        let omega = std::f64::consts::TAU * settings.natural_hz;
        let inertia = mass_matrix(&controller.model, &mut controller.data, position);
        for (j, joint) in joints.iter().enumerate() {
            controller.stiffness[j] = inertia[(j, j)] * omega * omega;
            controller.damping[j] = 2.0 * settings.damping * inertia[(j, j)] * omega;
            if settings.integral_time_s > 0.0 {
                controller.integral_gain[j] = controller.stiffness[j] / settings.integral_time_s;
            }
            controller.limit[j] = joint.effort;
        }
        controller
    }

    /// Takes one step of `dt_s` and leaves the effort in [`Controller::effort_nm`].
    pub fn update(&mut self, dt_s: f64, target: &Target, position: &[f64], velocity: &[f64]) {
        let n = position.len();
        let ahead = rnea(
            &self.model,
            &mut self.data,
            &target.position[..n],
            &target.velocity[..n],
            &target.acceleration[..n],
        );
        for j in 0..n {
            let error = target.position[j] - position[j];
            let error_rate = target.velocity[j] - velocity[j];
            let most = INTEGRAL_SHARE * self.limit[j];
            self.integral[j] =
                (self.integral[j] + self.integral_gain[j] * error * dt_s).clamp(-most, most);
            let effort = ahead[j]
                + self.stiffness[j] * error
                + self.damping[j] * error_rate
                + self.integral[j];
            self.effort_nm[j] = effort.clamp(-self.limit[j], self.limit[j]);
        }
    }
}
