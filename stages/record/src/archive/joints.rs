//! Joint states as ROS 2 messages, and statuses.

use tauscope_archive::ros::{self, DiagnosticStatus, KeyValue, Level};
use tauscope_archive::{TopicWriter, WriteError};
use tauscope_bus::{Header, JointArray};

use super::File;

/// A topic of joint states, with a reused message buffer.
pub(super) struct JointTopic {
    topic: TopicWriter<ros::JointState>,
    message: ros::JointState,
}

impl JointTopic {
    pub fn new(topic: TopicWriter<ros::JointState>, joints: &[String]) -> Self {
        let message = ros::JointState {
            name: joints.to_vec(),
            ..ros::JointState::default()
        };
        Self { topic, message }
    }

    /// Writes the given fields; the others stay empty.
    pub fn write(
        &mut self,
        file: &mut File,
        header: &Header,
        position: Option<&JointArray>,
        velocity: Option<&JointArray>,
        effort: Option<&JointArray>,
    ) -> Result<(), WriteError> {
        let count = self.message.name.len();
        self.message.header.stamp = ros::Time::from_ns(header.stamp_ns);
        for (to, from) in [
            (&mut self.message.position, position),
            (&mut self.message.velocity, velocity),
            (&mut self.message.effort, effort),
        ] {
            to.clear();
            to.extend(from.iter().flat_map(|values| &values[..count]));
        }
        file.write(self.topic, header, &self.message)
    }
}

/// Builds a status with its details.
pub(super) fn status(
    level: Level,
    name: &str,
    message: String,
    hardware_id: &str,
    values: impl IntoIterator<Item = (&'static str, String)>,
) -> DiagnosticStatus {
    DiagnosticStatus {
        level: level as u8,
        name: name.to_owned(),
        message,
        hardware_id: hardware_id.to_owned(),
        values: values
            .into_iter()
            .map(|(key, value)| KeyValue {
                key: key.to_owned(),
                value,
            })
            .collect(),
    }
}
