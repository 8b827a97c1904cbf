//! The external wrench at a point of the tool from the external joint torques: the inverse of τ = Jᵀ F
//! (Salt Ducaju et al., equation 9, which prints J⁺; the inverse of equation 2 is the pseudo-inverse of
//! Jᵀ, which is used here).

use nalgebra::{Matrix3, Vector3};
use tauscope_bus::{JointArray, MAX_JOINTS};
use tauscope_dynamics::{Model, point_jacobian};

use crate::frame::momentum::MomentumObserver;

/// Damping λ of the inverse, (J Jᵀ + λ² 1)⁻¹ J (Nakamura and Hanafusa, "Inverse Kinematic Solutions with
/// Singularity Robustness", 1986), in m for forces and rad for moments. A force with a lever of 1 cm to the
/// joints is reduced to half; with a lever of 20 cm, by 1/400.
/// Chosen: less damping turns noise into force in a singular pose, more reduces the forces at ordinary levers.
const DAMPING: f64 = 0.01;

/// A point of the tool. Computes its position and velocity, and the wrench at this point that explains the joint
/// torques. No allocation per call.
#[derive(Debug, Clone)]
pub struct ToolPoint {
    link: usize,
    /// Position in the link's frame \[m\].
    point: Vector3<f64>,
}

/// Motion and force at a [`ToolPoint`] at one instant, in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtTool {
    /// Position of the point \[m\].
    pub position_m: Vector3<f64>,
    /// Its velocity \[m/s\].
    pub velocity_m_per_s: Vector3<f64>,
    /// External force on the robot \[N\].
    pub force_n: Vector3<f64>,
}

impl ToolPoint {
    /// Creates the point `point_m` \[m, in the link's frame\] of `link`, an index into the model's links. Defaults:
    /// the [`Model::tool_link`] and its origin.
    pub fn new(model: &Model, link: Option<usize>, point_m: Option<[f64; 3]>) -> Self {
        Self {
            link: link.unwrap_or_else(|| model.tool_link()),
            point: point_m.unwrap_or_default().into(),
        }
    }

    /// Returns the link of the point.
    pub fn link(&self) -> usize {
        self.link
    }

    /// Returns position and velocity of the point at the observer's newest sample and `velocity` \[rad/s\], and the
    /// force of the least-squares wrench for the observed joint torques. Joints whose effort cannot be converted to a
    /// torque are ignored.
    pub fn at(&self, observer: &mut MomentumObserver, velocity: &JointArray) -> AtTool {
        let (mut torque_nm, mut weight) = ([0.0; MAX_JOINTS], [0.0; MAX_JOINTS]);
        for j in (0..MAX_JOINTS).filter(|&j| observer.knows(j)) {
            (torque_nm[j], weight[j]) = (observer.torque_nm()[j], 1.0);
        }
        let mut velocity_m_per_s = Vector3::zeros();
        // Blocks of J Jᵀ + λ² 1 and J τ: forces, forces with moments, moments. Symmetric blocks have only their lower
        // half.
        let damped = Matrix3::from_diagonal_element(DAMPING * DAMPING);
        let (mut forces, mut mixed, mut moments) = (damped, Matrix3::<f64>::zeros(), damped);
        let (mut pull, mut twist) = (Vector3::<f64>::zeros(), Vector3::<f64>::zeros());
        let add = |j: usize, linear: Vector3<f64>, angular: Vector3<f64>| {
            velocity_m_per_s += linear * velocity[j];
            pull += linear * torque_nm[j];
            twist += angular * torque_nm[j];
            let (pushed, turned) = (linear * weight[j], angular * weight[j]);
            for a in 0..3 {
                for b in 0..3 {
                    mixed[(a, b)] += pushed[a] * angular[b];
                    if b <= a {
                        forces[(a, b)] += pushed[a] * linear[b];
                        moments[(a, b)] += turned[a] * angular[b];
                    }
                }
            }
        };
        let position_m = observer
            .with_robot(|model, data| point_jacobian(model, data, self.link, &self.point, add));
        // The moment is eliminated. Both inverses exist: the damped matrix is positive definite, and so
        // are its last block and the Schur complement of that block.
        let force_n = symmetric_inverse(&moments).and_then(|inverse| {
            let through = mixed * inverse;
            let rest = forces - through * mixed.transpose();
            Some(symmetric_inverse(&rest)? * (pull - through * twist))
        });
        AtTool {
            position_m,
            velocity_m_per_s,
            force_n: force_n.unwrap_or_default(),
        }
    }
}

/// Returns the inverse of the symmetric matrix with the lower half in `lower`; `None` if it is singular.
fn symmetric_inverse(lower: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (a, b, c) = (lower.m11, lower.m21, lower.m31);
    let (d, e, f) = (lower.m22, lower.m32, lower.m33);
    let (aa, ab, ac) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let determinant = a * aa + b * ab + c * ac;
    if determinant == 0.0 {
        return None;
    }
    let (bb, bc, cc) = (a * f - c * c, b * c - a * e, a * d - b * b);
    let inverse = Matrix3::new(aa, ab, ac, ab, bb, bc, ac, bc, cc);
    Some(inverse * determinant.recip())
}
