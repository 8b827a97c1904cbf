//! Contact forces on the arm.

use nalgebra::Vector3;
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian, link_pose};

use super::super::link_point::LinkPoint;
use super::super::scenario::{ContactKind, LabelSpec};
use super::super::simulation::Event;
use super::Plant;

/// A contact force on the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in super::super) struct Contact {
    pub link: usize,
    /// Point of application in the link's frame \[m\].
    pub point_m: [f64; 3],
    /// Force on the robot, world frame \[N\].
    pub force_n: [f64; 3],
}

/// Subtracts `Jᵀ F` from the load.
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

impl Plant {
    /// Returns the position of a point of a link in the world \[m\], and its velocity \[m/s\].
    pub fn motion_of(&mut self, point: &LinkPoint) -> (Vector3<f64>, Vector3<f64>) {
        forward_kinematics(&self.model, &mut self.data, &self.link_position);
        let place = point.pose(&self.model, &self.data).translation.vector;
        let jacobian = point.jacobian(&self.model, &mut self.data);
        let mut velocity = Vector3::zeros();
        for (column, rate) in jacobian.column_iter().zip(&self.link_velocity) {
            velocity += column.fixed_rows::<3>(0) * *rate;
        }
        (place, velocity)
    }

    /// Converts a point of the world to a link's frame \[m\].
    pub fn in_link(&mut self, link: usize, world_m: Vector3<f64>) -> [f64; 3] {
        forward_kinematics(&self.model, &mut self.data, &self.link_position);
        let pose = link_pose(&self.model, &self.data, link);
        (pose.rotation.inverse() * (world_m - pose.translation.vector)).into()
    }

    /// Returns the labelled event of a contact whose peak is `peak`.
    pub fn event_of(
        &mut self,
        peak: &Contact,
        [on_s, off_s]: [f64; 2],
        kind: ContactKind,
        label: &LabelSpec,
    ) -> Event {
        let mut load = vec![0.0; self.link_position.len()];
        let (model, data) = (&self.model, &mut self.data);
        add_contact(model, data, &self.link_position, peak, &mut load);
        // `add_contact` has just computed the forward kinematics.
        let pose = link_pose(model, data, peak.link);
        let point = pose.translation.vector + pose.rotation * Vector3::from(peak.point_m);
        let mut joints = Vec::new();
        let mut moving = model.links()[peak.link].joint;
        while let Some(j) = moving {
            joints.push((model.joints()[j].name.clone(), -load[j]));
            moving = model.links()[model.joints()[j].parent_link].joint;
        }
        joints.reverse();
        Event {
            on_s,
            off_s,
            kind,
            link: self.link_name(peak.link).to_owned(),
            point_m: point.into(),
            force_n: peak.force_n,
            joints,
            label: label.clone(),
        }
    }
}
