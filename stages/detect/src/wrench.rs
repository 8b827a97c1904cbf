//! The external wrench at a point of the tool from the external joint torques: the inverse of τ = Jᵀ F
//! (Salt Ducaju et al., equation 9, which prints J⁺; the pseudo-inverse that undoes equation 2 is that
//! of Jᵀ, and it is the one taken here).

use nalgebra::{Matrix3, Vector3};
use tauscope_bus::JointArray;
use tauscope_dynamics::{Model, point_jacobian};

use crate::momentum::MomentumObserver;

/// Damping λ of the inverse, (J Jᵀ + λ² 1)⁻¹ J (Nakamura and Hanafusa, "Inverse Kinematic Solutions with
/// Singularity Robustness", 1986), in m for forces and rad for moments. Half of a direction that the
/// joints feel with a lever of 1 cm is left; with a lever of 20 cm, all but 1/400.
const DAMPING: f64 = 0.01;

/// A point of the tool: where it is, how it moves, and which wrench there explains joint torques. No
/// allocation per call.
#[derive(Debug, Clone)]
pub struct ToolPoint {
    link: usize,
    /// In the link's frame \[m\].
    point: Vector3<f64>,
}

/// What a [`ToolPoint`] says of one instant. World frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtTool {
    /// Where the point is \[m\].
    pub position_m: Vector3<f64>,
    /// Its velocity \[m/s\].
    pub velocity_m_per_s: Vector3<f64>,
    /// External force on the robot \[N\].
    pub force_n: Vector3<f64>,
}

impl ToolPoint {
    /// The point `point_m` \[m, in the link's frame\] of `link`, an index into the model's links; without
    /// them the origin of the [`Model::tool_link`].
    pub fn new(model: &Model, link: Option<usize>, point_m: Option<[f64; 3]>) -> Self {
        Self {
            link: link.unwrap_or_else(|| model.tool_link()),
            point: point_m.unwrap_or_default().into(),
        }
    }

    /// The link that the point is on.
    pub fn link(&self) -> usize {
        self.link
    }

    /// The point at the observer's newest sample and at `velocity` \[rad/s\], and the force in the wrench of
    /// least squares that the observed joint torques amount to; joints whose effort cannot be turned into a
    /// torque are passed over.
    pub fn at(&self, observer: &MomentumObserver, velocity: &JointArray) -> AtTool {
        let ((model, data), torque_nm) = (observer.robot(), observer.torque_nm());
        let mut velocity_m_per_s = Vector3::zeros();
        // J Jᵀ + λ² 1 and J τ by blocks: forces, forces against moments, moments.
        let damped = Matrix3::from_diagonal_element(DAMPING * DAMPING);
        let (mut forces, mut mixed, mut moments) = (damped, Matrix3::zeros(), damped);
        let (mut pull, mut twist) = (Vector3::zeros(), Vector3::zeros());
        let add = |j: usize, linear: Vector3<f64>, angular: Vector3<f64>| {
            velocity_m_per_s += linear * velocity[j];
            if observer.knows(j) {
                pull += linear * torque_nm[j];
                twist += angular * torque_nm[j];
                forces += linear * linear.transpose();
                mixed += linear * angular.transpose();
                moments += angular * angular.transpose();
            }
        };
        let position_m = point_jacobian(model, data, self.link, &self.point, add);
        // The moment is eliminated. Both inverses exist: the damped matrix is positive definite, and so
        // are its last block and what remains of the first.
        let force_n = moments.try_inverse().and_then(|inverse| {
            let through = mixed * inverse;
            let rest = forces - through * mixed.transpose();
            Some(rest.try_inverse()? * (pull - through * twist))
        });
        AtTool {
            position_m,
            velocity_m_per_s,
            force_n: force_n.unwrap_or_default(),
        }
    }
}
