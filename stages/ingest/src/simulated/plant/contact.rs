//! Forces of pushes.

use nalgebra::Vector3;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

/// A force that acts on the arm now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Contact {
    pub link: usize,
    /// In the link's frame \[m\].
    pub point_m: [f64; 3],
    /// On the robot, world frame \[N\].
    pub force_n: [f64; 3],
}

/// Takes `Jᵀ F` off the load.
pub(super) fn add_contact(
    model: &Model,
    data: &mut Data,
    position: &[f64],
    contact: &Contact,
    load: &mut [f64],
) {
    forward_kinematics(model, data, position);
    let pose = link_pose(model, data, contact.link);
    let force = Vector3::from(contact.force_n);
    let moment = (pose.rotation * Vector3::from(contact.point_m)).cross(&force);
    let jacobian = link_jacobian(model, data, contact.link);
    for (j, load) in load.iter_mut().enumerate() {
        for k in 0..3 {
            *load -= jacobian[(k, j)] * force[k] + jacobian[(k + 3, j)] * moment[k];
        }
    }
}
