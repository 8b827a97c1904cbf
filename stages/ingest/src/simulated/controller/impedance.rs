//! Cartesian impedance control after Salt Ducaju, Olofsson, Robertsson and Johansson, *Fast Contact
//! Detection and Classification for Kinesthetic Teaching in Robots using only Embedded Sensors*,
//! RO-MAN 2022.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Data, Model, forward_kinematics, rnea};

use super::super::error::ScenarioError;
use super::super::link_point::LinkPoint;
use super::super::plant::{Damping, Drive};
use super::super::scenario::{Damps, ImpedanceSpec};
use super::super::trajectory::{JointRange, Target};

/// Regularization of the null-space projection near singular postures \[m²\].
/// Resolution: 1 mm squared, far below the squared lever arms of a robot.
const SMOOTH: f64 = 1e-6;

/// Controller that holds the tool at its reference like a spring and a damper.
///
/// Equation 1 with I = 0, as in the paper's section III-A: `F = B Δξ' + K Δξ`, where Δξ is the
/// displacement of the tool from its reference and the vector part of the unit quaternion of its rotation,
/// both along the base's axes. Equations 2 and 3: `effort = Jᵀ F + C(q, qd) qd`, and gravity, which the
/// paper leaves to the robot's own controller.
///
/// A redundant arm can move without moving the tool. That null-space motion is held by
/// `N (k (q_d - q) + b (qd_d - qd))` with `N = 1 - Jᵀ (J Jᵀ)⁻¹ J`, which at rest does not change F.
#[derive(Debug)]
pub(in super::super) struct ImpedanceController {
    model: Model,
    data: Data,
    held: LinkPoint,
    /// Stiffness against translation \[N/m\], and against rotation per vector part of the quaternion \[N m\].
    stiffness: [f64; 2],
    damping: [f64; 2],
    damps: Damps,
    null_stiffness: f64,
    null_damping: f64,
    limit: JointArray,
    effort_nm: JointArray,
    /// The part of the damping that acts on the joints' velocities, `Jᵀ B J + b N`.
    joint_damping: DMatrix<f64>,
}

impl ImpedanceController {
    pub fn new(
        model: &Model,
        spec: &ImpedanceSpec,
        joints: &[JointRange],
    ) -> Result<Self, ScenarioError> {
        let mut limit = [f64::INFINITY; MAX_JOINTS];
        for (limit, joint) in limit.iter_mut().zip(joints) {
            *limit = joint.effort;
        }
        // b = 2 ζ √k, the damping of a unit mass.
        let damping = |given: Option<f64>, stiffness: f64| {
            given.unwrap_or(2.0 * spec.damping_ratio * stiffness.sqrt())
        };
        let link = spec.link.as_deref();
        Ok(Self {
            held: LinkPoint::find(model, "controller.impedance", link, spec.point_m)?,
            stiffness: [spec.translational_n_per_m, spec.rotational_nm_per_rad],
            damping: [
                damping(spec.translational_ns_per_m, spec.translational_n_per_m),
                damping(spec.rotational_nms_per_rad, spec.rotational_nm_per_rad),
            ],
            damps: spec.damps,
            null_stiffness: spec.null_space_nm_per_rad,
            null_damping: damping(spec.null_space_nms_per_rad, spec.null_space_nm_per_rad),
            limit,
            effort_nm: [0.0; MAX_JOINTS],
            joint_damping: DMatrix::zeros(joints.len(), joints.len()),
            data: Data::new(model),
            model: model.clone(),
        })
    }

    /// Computes the effort for a new target and the encoder readings.
    pub fn update(&mut self, target: &Target, position: &[f64], velocity: &[f64]) {
        let n = position.len();
        let (model, data) = (&self.model, &mut self.data);
        forward_kinematics(model, data, &target.position[..n]);
        let reference = self.held.pose(model, data);
        let target_velocity = DVector::from_column_slice(&target.velocity[..n]);
        let reference_velocity = self.held.jacobian(model, data) * &target_velocity;
        forward_kinematics(model, data, position);
        let pose = self.held.pose(model, data);
        let jacobian = self.held.jacobian(model, data);

        let displacement = reference.translation.vector - pose.translation.vector;
        // A quaternion and its negative are the same rotation; the sign of w selects the shorter way.
        let rotation = pose.rotation.inverse() * reference.rotation;
        let vector_part = pose.rotation * (rotation.imag() * rotation.w.signum());
        // The vector part's derivative is half the difference of the angular velocities, as long as the
        // rotation is small.
        let damping = [self.damping[0], 0.5 * self.damping[1]];
        let mut force = Vector6::zeros();
        let mut damped = Vector6::zeros();
        for k in 0..6 {
            let half = k / 3;
            let variation = if half == 0 {
                displacement[k]
            } else {
                vector_part[k - 3]
            };
            force[k] = self.stiffness[half] * variation;
            if self.damps == Damps::Variation {
                force[k] += damping[half] * reference_velocity[k];
            }
            damped[k] = damping[half];
        }

        let transposed = jacobian.transpose();
        let square = &jacobian * &transposed + Matrix6::identity() * SMOOTH;
        let mut null_space = DMatrix::identity(n, n);
        // Positive definite, unless a position is NaN.
        if let Some(factors) = square.cholesky() {
            null_space -= &transposed * factors.solve(&jacobian);
        }
        let posture = DVector::from_fn(n, |j, _| {
            self.null_stiffness * (target.position[j] - position[j])
                + self.null_damping * target.velocity[j]
        });
        let task = &transposed * force + &null_space * posture;
        let bias = rnea(model, data, position, velocity, &[0.0; MAX_JOINTS][..n]);
        for j in 0..n {
            self.effort_nm[j] = bias[j] + task[j];
        }
        self.joint_damping = &transposed * Matrix6::from_diagonal(&damped) * &jacobian
            + null_space * self.null_damping;
    }

    /// Returns the command to the drives.
    pub fn drive(&self) -> Drive<'_> {
        Drive {
            effort_nm: &self.effort_nm,
            damping: Damping::Coupled(&self.joint_damping),
            velocity: &[0.0; MAX_JOINTS],
            limit_nm: &self.limit,
        }
    }
}
