//! From readings to the messages that a driver would publish.

use tauscope_archive::ros;
use tauscope_dynamics::Model;

use super::simulation::Reading;

/// A cell's messages; their memory is used again for each reading.
#[derive(Debug)]
pub(super) struct CellMessages {
    joint_count: usize,
    velocity: bool,
    /// On `/joint_states`.
    pub state: ros::JointState,
    /// On `/joint_commands`.
    pub command: ros::JointState,
    /// On `/contact`.
    pub contact: ros::Bool,
    /// On `/learn`, where it is true.
    pub learn: ros::Bool,
}

impl CellMessages {
    pub fn new(model: &Model, velocity: bool) -> Self {
        let message = || ros::JointState {
            name: model.joints().iter().map(|j| j.name.clone()).collect(),
            ..ros::JointState::default()
        };
        Self {
            joint_count: model.dof(),
            velocity,
            state: message(),
            command: message(),
            contact: ros::Bool::default(),
            learn: ros::Bool::default(),
        }
    }

    /// Fills them with a reading.
    pub fn fill(&mut self, reading: &Reading) {
        let n = self.joint_count;
        let stamp = ros::Time::from_ns(reading.stamp_ns);
        let state = &mut self.state;
        state.header.stamp = stamp;
        copy(&mut state.position, &reading.position[..n]);
        copy(
            &mut state.velocity,
            &reading.velocity[..if self.velocity { n } else { 0 }],
        );
        copy(&mut state.effort, &reading.effort[..n]);
        self.command.header.stamp = stamp;
        copy(&mut self.command.position, &reading.command_position[..n]);
        self.contact.data = reading.contact;
        self.learn.data = reading.learn;
    }
}

fn copy(target: &mut Vec<f64>, values: &[f64]) {
    target.clear();
    target.extend_from_slice(values);
}
