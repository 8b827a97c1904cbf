//! The external wrench at a point of the tool from the external joint torques: the inverse of τ = Jᵀ F
//! (Salt Ducaju et al., equation 9, which prints J⁺; the pseudo-inverse that undoes equation 2 is that
//! of Jᵀ, and it is the one taken here).

use nalgebra::{Matrix6, Point3, Vector3, Vector6};
use tauscope_bus::JointArray;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

/// Damping λ of the inverse, (J Jᵀ + λ² 1)⁻¹ J (Nakamura and Hanafusa, "Inverse Kinematic Solutions with
/// Singularity Robustness", 1986), in m for forces and rad for moments. Half of a direction that the
/// joints feel with a lever of 1 cm is left; with a lever of 20 cm, all but 1/400.
const DAMPING: f64 = 0.01;

/// A point of the tool: where it is, how it moves, and which wrench there explains joint torques. No
/// allocation per call.
#[derive(Debug, Clone)]
pub struct ToolPoint {
    model: Model,
    data: Data,
    link: usize,
    /// In the link's frame \[m\].
    point: Point3<f64>,
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
    /// External moment on the robot about the point \[N m\].
    pub moment_nm: Vector3<f64>,
}

impl ToolPoint {
    /// The point `point_m` \[m, in the link's frame\] of `link`, an index into the model's links; without
    /// them the origin of the [`Model::tool_link`].
    pub fn new(model: &Model, link: Option<usize>, point_m: Option<[f64; 3]>) -> Self {
        Self {
            link: link.unwrap_or_else(|| model.tool_link()),
            point: point_m.unwrap_or_default().into(),
            data: Data::new(model),
            model: model.clone(),
        }
    }

    /// The link that the point is on.
    pub fn link(&self) -> usize {
        self.link
    }

    /// The point at `position` \[rad\] and `velocity` \[rad/s\], and the wrench of least squares that the
    /// external joint torques `torque_nm` amount to; joints for which `knows` is false are passed over.
    pub fn at(
        &mut self,
        position: &JointArray,
        velocity: &JointArray,
        torque_nm: &JointArray,
        knows: impl Fn(usize) -> bool,
    ) -> AtTool {
        let Self {
            model,
            data,
            link,
            point,
        } = self;
        let n = model.dof();
        forward_kinematics(model, data, &position[..n]);
        let pose = link_pose(model, data, *link);
        let arm = pose.rotation * point.coords;
        let jacobian = link_jacobian(model, data, *link);
        let (mut twist, mut pull, mut gram) =
            (Vector3::zeros(), Vector6::zeros(), Matrix6::zeros());
        for j in 0..n {
            let mut column: Vector6<f64> = jacobian.column(j).into();
            let angular: Vector3<f64> = column.fixed_rows::<3>(3).into();
            let linear = column.fixed_rows::<3>(0) + angular.cross(&arm);
            column.fixed_rows_mut::<3>(0).copy_from(&linear);
            twist += linear * velocity[j];
            if knows(j) {
                pull += column * torque_nm[j];
                gram += column * column.transpose();
            }
        }
        gram += Matrix6::identity() * (DAMPING * DAMPING);
        // Positive definite by its damping.
        let wrench = gram
            .cholesky()
            .map_or_else(Vector6::zeros, |gram| gram.solve(&pull));
        AtTool {
            position_m: pose.translation.vector + arm,
            velocity_m_per_s: twist,
            force_n: wrench.fixed_rows::<3>(0).into(),
            moment_nm: wrench.fixed_rows::<3>(3).into(),
        }
    }
}
