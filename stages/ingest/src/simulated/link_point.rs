//! Pose and Jacobian of a point of a link.

use nalgebra::{Isometry3, Matrix6xX, Vector3};
use tauscope_dynamics::{Data, Model, link_jacobian, link_pose};

use super::error::ScenarioError;
use super::push::find_link;

/// A point that is fixed to a link. Its methods require the forward kinematics in `data`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LinkPoint {
    /// The link's place in the model.
    pub link: usize,
    /// In the link's frame \[m\].
    pub point_m: Vector3<f64>,
}

impl LinkPoint {
    /// The point of the link with this name, by default of the one that holds tools.
    pub fn find(
        model: &Model,
        what: &'static str,
        link: Option<&str>,
        point_m: [f64; 3],
    ) -> Result<Self, ScenarioError> {
        let link = match link {
            Some(name) => find_link(model, what, name)?,
            None => model.tool_link(),
        };
        Ok(Self {
            link,
            point_m: point_m.into(),
        })
    }

    /// The link's frame moved to the point, in the world.
    pub fn pose(&self, model: &Model, data: &Data) -> Isometry3<f64> {
        let mut pose = link_pose(model, data, self.link);
        pose.translation.vector += pose.rotation * self.point_m;
        pose
    }

    /// Jacobian of the point: rows are linear and then angular velocity along the world's axes.
    pub fn jacobian(&self, model: &Model, data: &mut Data) -> Matrix6xX<f64> {
        let arm = link_pose(model, data, self.link).rotation * self.point_m;
        let mut jacobian = link_jacobian(model, data, self.link).clone();
        for mut column in jacobian.column_iter_mut() {
            let turn = Vector3::new(column[3], column[4], column[5]);
            let carried = turn.cross(&arm);
            for k in 0..3 {
                column[k] += carried[k];
            }
        }
        jacobian
    }
}
