//! Topics of a recording.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::ros::JointStateType;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Type of its messages, e.g. `sensor_msgs/msg/JointState`; empty if the recording does not say.
    pub type_name: String,
    /// How a message is encoded: `cdr` in ROS 2.
    pub message_encoding: String,
    /// Hash of the type, if the recording says it.
    pub type_hash: Option<String>,
    /// The quality of service that its publishers offered, as YAML, if the recording says it.
    #[serde(skip)]
    pub offered_qos: Option<String>,
    /// Messages that can be read.
    pub message_count: u64,
}

impl Topic {
    /// Of which type its joint states are, if it carries any that can be read.
    pub fn joint_state_type(&self) -> Option<JointStateType> {
        let of = JointStateType::of(&self.type_name);
        of.filter(|_| self.message_encoding == "cdr")
    }
}

/// The topics of a recording, and which channel belongs to which.
#[derive(Debug, Default)]
pub(crate) struct Topics {
    pub(crate) list: Vec<Topic>,
    /// Name, type and encoding: a file may declare tens of thousands.
    known: BTreeMap<(String, String, String), usize>,
    by_channel: BTreeMap<u16, usize>,
}

impl Topics {
    /// Adds a topic as [`Topics::add`] does, to which the channel belongs.
    pub(crate) fn add_channel(&mut self, channel: u16, topic: Topic) {
        let index = self.add(topic);
        self.by_channel.insert(channel, index);
    }

    /// Adds a topic, or its messages to the one of the same name and type.
    pub(crate) fn add(&mut self, topic: Topic) -> usize {
        let same = (
            topic.name.clone(),
            topic.type_name.clone(),
            topic.message_encoding.clone(),
        );
        if let Some(&index) = self.known.get(&same) {
            self.list[index].message_count += topic.message_count;
            return index;
        }
        self.list.push(topic);
        self.known.insert(same, self.list.len() - 1);
        self.list.len() - 1
    }

    pub(crate) fn of_channel(&self, channel: u16) -> Option<usize> {
        self.by_channel.get(&channel).copied()
    }
}
