//! Joint control: PD, an integral part, and feedforward of the nominal model's effort.
//!
//! As in a real arm, the position loop is slow and the drives' velocity loops are fast: the former is
//! sampled, the latter act without delay, so that control is stable however light a joint is.

use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Data, Model, mass_matrix, rnea};

use super::super::plant::{Damping, Drive};
use super::super::scenario::ControllerSettings;
use super::super::trajectory::{JointRange, Target};

/// Largest fraction of a joint's effort limit that the integral part may use.
/// Chosen: for simulated cells only; enough for the friction and the payload that the feedforward lacks; more winds
/// up when an obstacle holds the arm.
const INTEGRAL_SHARE: f64 = 0.5;
/// Acceleration of a motor's free rotor at its effort limit, from which the rotor's inertia is estimated
/// \[rad/s²\]. Gains are designed for that inertia where it exceeds the arm's.
/// Physical: arms are rated for 10 to 20 rad/s² under load; without load a motor reaches somewhat more.
const MOTOR_ACCELERATION: f64 = 30.0;

/// Position control of each joint.
#[derive(Debug)]
pub(in super::super) struct JointController {
    model: Model,
    data: Data,
    stiffness: JointArray,
    damping: JointArray,
    integral_gain: JointArray,
    integral: JointArray,
    limit: JointArray,
    target: Target,
    effort_nm: JointArray,
    velocity_target: JointArray,
}

impl JointController {
    /// Creates a controller whose gains give each joint the configured frequency and damping with the arm
    /// at `position`.
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
            target: Target::default(),
            effort_nm: [0.0; MAX_JOINTS],
            velocity_target: [0.0; MAX_JOINTS],
        };
        let omega = std::f64::consts::TAU * settings.natural_hz;
        let inertia = mass_matrix(&controller.model, &mut controller.data, position);
        for (j, joint) in joints.iter().enumerate() {
            let mut inertia = inertia[(j, j)];
            if joint.effort.is_finite() {
                inertia = inertia.max(joint.effort / MOTOR_ACCELERATION);
            }
            controller.stiffness[j] = inertia * omega * omega;
            controller.damping[j] = 2.0 * settings.damping * inertia * omega;
            if settings.integral_time_s > 0.0 {
                controller.integral_gain[j] = controller.stiffness[j] / settings.integral_time_s;
            }
            controller.limit[j] = joint.effort;
        }
        controller
    }

    /// Takes a new target, `dt_s` after the previous one.
    pub fn update(&mut self, dt_s: f64, target: &Target, position: &[f64]) {
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
            let most = INTEGRAL_SHARE * self.limit[j];
            self.integral[j] =
                (self.integral[j] + self.integral_gain[j] * error * dt_s).clamp(-most, most);
            self.effort_nm[j] = ahead[j] + self.stiffness[j] * error + self.integral[j];
        }
        self.target = *target;
    }

    /// Returns the command to the drives, `elapsed_s` after the target.
    pub fn drive(&mut self, elapsed_s: f64) -> Drive<'_> {
        for (j, velocity) in self.velocity_target.iter_mut().enumerate() {
            *velocity = self.target.velocity[j] + elapsed_s * self.target.acceleration[j];
        }
        Drive {
            effort_nm: &self.effort_nm,
            damping: Damping::Joints(&self.damping),
            velocity: &self.velocity_target,
            limit_nm: &self.limit,
        }
    }
}
