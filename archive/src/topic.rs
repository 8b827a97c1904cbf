//! Topics of a recording.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::ros::{self, JointStateType};
use crate::ros1_convert::Conversion;
use crate::unreadable::UnreadableJointStates;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Topic {
    /// Its name.
    pub name: String,
    /// Type of its messages, e.g. `sensor_msgs/msg/JointState`; empty if the recording does not say.
    pub type_name: String,
    /// Encoding of the messages as they are given: `cdr` in ROS 2. Joint states and flags of ROS 1 are given as CDR.
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
    /// Type of its joint states, if it carries any that can be read.
    pub fn joint_state_type(&self) -> Option<JointStateType> {
        let of = JointStateType::of(&self.type_name);
        of.filter(|_| self.message_encoding == "cdr")
    }

    /// Reason why its joint states cannot be read, if its type is a joint state in an unsupported encoding.
    pub fn unreadable_joint_states(&self) -> Option<UnreadableJointStates> {
        UnreadableJointStates::of(&self.name, &self.type_name, &self.message_encoding)
    }
}

/// The topics of a recording, and which channel belongs to which.
#[derive(Debug, Default)]
pub(crate) struct Topics {
    pub(crate) list: Vec<Topic>,
    /// Conversion of the stored messages, by topic; `None` if they are given as stored.
    conversions: Vec<Option<Conversion>>,
    /// Name, type, encoding and conversion: a file may declare tens of thousands.
    known: BTreeMap<(String, String, String, Option<Conversion>), usize>,
    by_channel: BTreeMap<u16, usize>,
}

impl Topics {
    /// Adds a topic as [`Topics::add_stored`] does, to which the channel belongs.
    pub(crate) fn add_channel(&mut self, channel: u16, topic: Topic, md5sum: &str) {
        let index = self.add_stored(topic, md5sum);
        self.by_channel.insert(channel, index);
    }

    /// Adds a topic as a file declares it, or its messages to the one of the same name and type. `md5sum` is the hash
    /// of a ROS 1 definition, or empty.
    pub(crate) fn add_stored(&mut self, mut topic: Topic, md5sum: &str) -> usize {
        let ros2_type = ros::ros2_type(&topic.type_name);
        let conversion = match topic.message_encoding.as_str() {
            "cdr" => {
                topic.type_name = ros2_type;
                None
            }
            "ros1" => Conversion::of(&ros2_type),
            _ => None,
        };
        let conversion = conversion.filter(|conversion| {
            let fits = conversion.fits(md5sum);
            if fits {
                conversion.type_name().clone_into(&mut topic.type_name);
                "cdr".clone_into(&mut topic.message_encoding);
                topic.type_hash = Some(conversion.type_hash().to_owned());
            } else {
                topic.message_encoding = format!("ros1 of another definition, md5sum {md5sum}");
            }
            fits
        });
        self.add(topic, conversion)
    }

    /// Adds the topics of a part, and gives the place of each in this list.
    pub(crate) fn add_part(&mut self, part: &Self) -> Vec<usize> {
        let topics = part.list.iter().zip(&part.conversions);
        let places = topics.map(|(topic, &conversion)| self.add(topic.clone(), conversion));
        places.collect()
    }

    fn add(&mut self, topic: Topic, conversion: Option<Conversion>) -> usize {
        let same = (
            topic.name.clone(),
            topic.type_name.clone(),
            topic.message_encoding.clone(),
            conversion,
        );
        if let Some(&index) = self.known.get(&same) {
            self.list[index].message_count += topic.message_count;
            return index;
        }
        self.list.push(topic);
        self.conversions.push(conversion);
        self.known.insert(same, self.list.len() - 1);
        self.list.len() - 1
    }

    pub(crate) fn of_channel(&self, channel: u16) -> Option<usize> {
        self.by_channel.get(&channel).copied()
    }

    /// Conversion of the stored messages of a topic.
    pub(crate) fn conversion(&self, topic: usize) -> Option<Conversion> {
        self.conversions[topic]
    }
}
