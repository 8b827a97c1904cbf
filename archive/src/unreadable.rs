//! Joint states in an encoding that cannot be read.

use serde::Serialize;

use crate::ros::JointStateType;

/// Type names of joint states in any convention, as last part, in lower case and without `_`.
/// From: ROS, and the well-known schemas of Foxglove.
const NAMES: [&str; 4] = [
    "jointstate",
    "jointstates",
    "dynamicjointstate",
    "dynamicjointstates",
];

/// A topic with joint states in an encoding that cannot be read, such as JSON or Protobuf.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnreadableJointStates {
    /// Topic name.
    pub topic: String,
    /// Type name as the recording gives it; empty if there is none.
    pub type_name: String,
    /// Encoding of the messages as the recording gives it, e.g. `json` or `protobuf`.
    pub encoding: String,
}

impl UnreadableJointStates {
    /// Those of a topic. Without a type name, the topic name decides.
    pub(crate) fn of(topic: &str, type_name: &str, encoding: &str) -> Option<Self> {
        let readable = encoding == "cdr" && JointStateType::of(type_name).is_some();
        let untyped_cdr = encoding == "cdr" && type_name.is_empty();
        let name = if type_name.is_empty() {
            topic
        } else {
            type_name
        };
        (is_joint_state(name) && !readable && !untyped_cdr).then(|| Self {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            encoding: encoding.to_owned(),
        })
    }
}

fn is_joint_state(name: &str) -> bool {
    let last = name.rsplit(['/', '.', ':']).next().unwrap_or_default();
    let plain: String = last.chars().filter(|&letter| letter != '_').collect();
    NAMES.contains(&plain.to_lowercase().as_str())
}

impl std::fmt::Display for UnreadableJointStates {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            topic,
            type_name,
            encoding,
        } = self;
        write!(f, "topic {topic:?} carries joint states")?;
        if !type_name.is_empty() {
            write!(f, " of type {type_name}")?;
        }
        match encoding.as_str() {
            "cdr" => write!(f, "; only {} can be read", JointStateType::names())?,
            "" => f.write_str(" without an encoding; only CDR and ros1 messages can be read")?,
            other => write!(f, " as {other:?}; only CDR and ros1 messages can be read")?,
        }
        write!(
            f,
            ". Record the topic with `ros2 bag record`, or rewrite its messages as {} in CDR, for example with the \
             Python package mcap-ros2-support",
            JointStateType::JointState.name(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::UnreadableJointStates;

    fn unreadable(topic: &str, type_name: &str, encoding: &str) -> bool {
        UnreadableJointStates::of(topic, type_name, encoding).is_some()
    }

    #[test]
    fn joint_states_are_known_by_their_type_name() {
        for name in [
            "foxglove.JointStates",
            "sensor_msgs.JointState",
            "ros.sensor_msgs.msg.JointState",
            "sensor_msgs/msg/JointState",
            "sensor_msgs/JointState",
            "control_msgs/msg/DynamicJointState",
            "joint_state",
        ] {
            assert!(unreadable("/arm", name, "protobuf"), "{name}");
        }
        assert!(!unreadable("/arm", "sensor_msgs/msg/JointState", "cdr"));
        assert!(unreadable("/arm", "acme_msgs/msg/JointState", "cdr"));
        assert!(!unreadable("/joint_states", "foxglove.Log", "protobuf"));
    }

    #[test]
    fn topics_without_a_type_are_known_by_their_name() {
        assert!(unreadable("/joint_states", "", "json"));
        assert!(unreadable("/left/joint_states", "", ""));
        assert!(!unreadable("/joint_states", "", "cdr"));
        assert!(!unreadable("/joint_commands", "", "json"));
    }
}
