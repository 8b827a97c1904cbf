//! A recording in any of the supported formats.

mod body;
mod joint_states;
mod messages;
mod open;
mod places;
mod several;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use crate::chunks::Order;
use crate::csv_file::CsvTable;
use crate::cursor::Cursor;
use crate::damage::Damage;
use crate::error::ArchiveError;
use crate::lerobot::Episode;
use crate::mcap_file::{Layout, mcap_cursor};
use crate::mcap_write::PROVENANCE;
use crate::ros;
use crate::ros1_bag::{Ros1Bag, ros1_cursor};
use crate::sqlite_file::SqliteFile;
use crate::topic::{Topic, Topics};
use crate::unreadable::UnreadableJointStates;

pub use joint_states::{JointStates, Stamped};
pub use messages::{Message, Messages};
pub use places::{Sources, is_there, name_of, recordings_at, sources};
use several::{Part, SeveralCursor};

/// Storage format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingKind {
    /// One MCAP file.
    Mcap,
    /// One SQLite file of rosbag2.
    Sqlite,
    /// The folder of a rosbag2 bag.
    Rosbag2,
    /// A bag of ROS 1.
    Ros1Bag,
    /// A table of numbers.
    Csv,
    /// An episode of a LeRobot data set.
    Lerobot,
}

impl RecordingKind {
    /// Returns whether it is a table of rows, which has neither topics nor log times of its own.
    pub fn is_table(self) -> bool {
        matches!(self, Self::Csv | Self::Lerobot)
    }
}

impl std::fmt::Display for RecordingKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mcap => "MCAP file",
            Self::Sqlite => "SQLite file of rosbag2",
            Self::Rosbag2 => "rosbag2 bag",
            Self::Ros1Bag => "bag of ROS 1",
            Self::Csv => "CSV table",
            Self::Lerobot => "episode of a LeRobot data set",
        })
    }
}

/// An open recording. Its topics and times are known; its messages have not been read.
pub struct Recording {
    path: PathBuf,
    kind: RecordingKind,
    topics: Arc<Topics>,
    log_times_ns: Option<(i64, i64)>,
    bytes: u64,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    damage: Vec<Damage>,
    store: Store,
}

enum Store {
    Mcap(Arc<Layout>),
    Sqlite {
        file: Box<SqliteFile>,
        /// Index in the list of topics, by the number of the topic in the database.
        numbers: BTreeMap<i64, usize>,
    },
    Ros1 {
        bag: Arc<Ros1Bag>,
        /// Index in the list of topics, by the number of the connection.
        topics: BTreeMap<u32, usize>,
    },
    Several(Arc<Vec<Part>>),
    Csv(Box<CsvTable>),
    Lerobot(Box<Episode>),
}

impl Recording {
    /// Returns its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns its storage format.
    pub fn kind(&self) -> RecordingKind {
        self.kind
    }

    /// Returns its size on disk \[bytes\].
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns its metadata records (MCAP only): keys and values by the name of the record.
    pub fn metadata(&self) -> &BTreeMap<String, BTreeMap<String, String>> {
        &self.metadata
    }

    /// Returns its provenance, if it was written by tauscope: versions, and hashes of the inputs.
    pub fn provenance(&self) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(PROVENANCE)
    }

    /// Returns its topics, with their types and message counts.
    pub fn topics(&self) -> &[Topic] {
        &self.topics.list
    }

    /// Returns the log time of the first message \[ns since the epoch\]; `None` if it is empty.
    pub fn start_ns(&self) -> Option<i64> {
        self.log_times_ns.map(|(start_ns, _)| start_ns)
    }

    /// Returns the log time of the last message \[ns since the epoch\]; `None` if it is empty.
    pub fn end_ns(&self) -> Option<i64> {
        self.log_times_ns.map(|(_, end_ns)| end_ns)
    }

    /// Returns the number of readable messages over all topics.
    pub fn message_count(&self) -> u64 {
        self.topics().iter().map(|topic| topic.message_count).sum()
    }

    /// Returns the damage known so far. A corrupt chunk in a file with a sound index is found only when it is read,
    /// and is then reported by [`Messages`].
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// Returns sentences on what was recognised when the recording was opened: columns, units and time of a CSV
    /// table. Empty for other formats.
    pub fn remarks(&self) -> &[String] {
        match &self.store {
            Store::Csv(table) => &table.remarks,
            _ => &[],
        }
    }

    /// Checks that its format allows a comparison of its joint states with expected efforts of `joints`. A LeRobot
    /// data set may have no efforts, undeclared positions in degrees, or other names for the joints.
    ///
    /// # Errors
    /// [`ArchiveError::Lerobot`], with the remedy.
    pub fn check_comparable(&self, joints: &[String]) -> Result<(), ArchiveError> {
        match &self.store {
            Store::Lerobot(episode) => episode.check_comparable(joints),
            _ => Ok(()),
        }
    }

    /// Returns the topic `name`, which must carry at least one message, of type `M` as CDR.
    ///
    /// # Errors
    /// [`ArchiveError::Empty`], [`ArchiveError::NoSuchTopic`], [`ArchiveError::WrongType`] or
    /// [`ArchiveError::NoMessages`].
    pub fn topic_of<M: ros::Message>(&self, name: &str) -> Result<&Topic, ArchiveError> {
        let is_one = |topic: &Topic| topic.type_name == M::TYPE && topic.message_encoding == "cdr";
        self.topic_where(name, M::TYPE, is_one)
    }

    /// Returns the topic `name`, which must carry at least one joint state, of any type as CDR.
    ///
    /// # Errors
    /// As [`Recording::topic_of`], and [`ArchiveError::UnreadableJointStates`] for joint states in another encoding.
    pub fn joint_state_topic(&self, name: &str) -> Result<&Topic, ArchiveError> {
        let is_one = |topic: &Topic| topic.joint_state_type().is_some();
        let found = self.topic_where(name, &ros::JointStateType::names(), is_one);
        let Err(ArchiveError::WrongType { .. }) = found else {
            return found;
        };
        let same = self.unreadable_joint_states();
        match same.into_iter().find(|each| each.topic == name) {
            Some(found) => Err(ArchiveError::UnreadableJointStates {
                path: self.path.clone(),
                found: Box::new(found),
            }),
            None => found,
        }
    }

    /// Returns the topics with joint states in an unsupported encoding.
    pub fn unreadable_joint_states(&self) -> Vec<UnreadableJointStates> {
        let topics = self.topics().iter();
        topics.filter_map(Topic::unreadable_joint_states).collect()
    }

    fn topic_where(
        &self,
        name: &str,
        type_name: &str,
        is_one: impl Fn(&Topic) -> bool,
    ) -> Result<&Topic, ArchiveError> {
        if self.message_count() == 0 {
            return Err(ArchiveError::Empty {
                path: self.path.clone(),
                known: self.topic_names(),
            });
        }
        let indexes = self.topic_indexes(name)?;
        let topic = |&index: &usize| &self.topics.list[index];
        let found = indexes.iter().map(topic).find(|&topic| is_one(topic));
        let topic = found.unwrap_or(topic(&indexes[0]));
        if !is_one(topic) {
            return Err(ArchiveError::WrongType {
                path: self.path.clone(),
                topic: name.to_owned(),
                found: format!("{} as {:?}", topic.type_name, topic.message_encoding),
                expected: format!("{type_name} as \"cdr\""),
            });
        }
        if topic.message_count == 0 {
            return Err(ArchiveError::NoMessages {
                path: self.path.clone(),
                topic: name.to_owned(),
            });
        }
        Ok(topic)
    }

    /// Returns the number of chunks of an MCAP file or a bag of ROS 1, counted as in [`Messages::chunks_read`]; 0 for
    /// other formats.
    pub fn chunks(&self) -> u64 {
        match &self.store {
            Store::Mcap(layout) => layout.chunks(),
            Store::Several(parts) => parts.iter().map(|part| part.recording.chunks()).sum(),
            Store::Ros1 { bag, .. } => bag.chunks(),
            Store::Sqlite { .. } | Store::Csv(_) | Store::Lerobot(_) => 0,
        }
    }

    /// Returns the messages of these topics in the order of their log times.
    ///
    /// # Errors
    /// [`ArchiveError::NoSuchTopic`], or if the recording can no longer be opened.
    pub fn messages(&self, topics: &[&str]) -> Result<Messages, ArchiveError> {
        self.messages_within(topics, i64::MIN..=i64::MAX)
    }

    /// Like [`Recording::messages`], but only with log times in `within_ns` \[ns since the epoch\]. Chunks outside
    /// this range are not read, and their damage is not reported.
    ///
    /// # Errors
    /// As [`Recording::messages`].
    pub fn messages_within(
        &self,
        topics: &[&str],
        within_ns: RangeInclusive<i64>,
    ) -> Result<Messages, ArchiveError> {
        let mut wanted = vec![false; self.topics.list.len()];
        for name in topics {
            for index in self.topic_indexes(name)? {
                wanted[index] = true;
            }
        }
        self.read(&wanted, within_ns)
    }

    /// Returns all messages in the order of their log times.
    ///
    /// # Errors
    /// If the recording can no longer be opened.
    pub fn all_messages(&self) -> Result<Messages, ArchiveError> {
        self.read(&vec![true; self.topics.list.len()], i64::MIN..=i64::MAX)
    }

    /// Returns the joint states on `topic`, decoded, in the order of their log times.
    ///
    /// # Errors
    /// As [`Recording::joint_state_topic`] and [`Recording::messages`].
    pub fn joint_states(&self, topic: &str) -> Result<JointStates, ArchiveError> {
        self.joint_state_topic(topic)?;
        Ok(JointStates::new(self.messages(&[topic])?))
    }

    fn read(
        &self,
        wanted: &[bool],
        within_ns: RangeInclusive<i64>,
    ) -> Result<Messages, ArchiveError> {
        Ok(Messages::new(
            &self.path,
            Arc::clone(&self.topics),
            self.cursor(wanted, &within_ns)?,
            within_ns,
        ))
    }

    /// Creates a cursor over the topics marked in `wanted`, by their index in [`Recording::topics`].
    fn cursor(
        &self,
        wanted: &[bool],
        within_ns: &RangeInclusive<i64>,
    ) -> Result<Box<dyn Cursor>, ArchiveError> {
        match &self.store {
            Store::Mcap(layout) => {
                let topic = |channel| {
                    let topic = self.topics.of_channel(channel)?;
                    wanted[topic].then_some(topic)
                };
                let cursor = mcap_cursor(Arc::clone(layout), Order::LogTime, topic)?;
                Ok(Box::new(cursor.within(within_ns)))
            }
            Store::Sqlite { file, numbers } => {
                let topic = |id| numbers.get(&id).copied().filter(|&topic| wanted[topic]);
                Ok(Box::new(file.cursor(topic)?))
            }
            Store::Ros1 { bag, topics } => {
                let topic = |number| topics.get(&number).copied().filter(|&topic| wanted[topic]);
                let cursor = ros1_cursor(Arc::clone(bag), topic)?;
                Ok(Box::new(cursor.within(within_ns)))
            }
            Store::Several(parts) => Ok(Box::new(SeveralCursor::new(
                Arc::clone(parts),
                wanted,
                within_ns.clone(),
            ))),
            Store::Csv(table) => Ok(Box::new(table.cursor()?)),
            Store::Lerobot(episode) => Ok(Box::new(episode.cursor()?)),
        }
    }

    /// Returns the indices of all topics of that name; publishers may disagree on the type.
    fn topic_indexes(&self, name: &str) -> Result<Vec<usize>, ArchiveError> {
        let named = |&i: &usize| self.topics.list[i].name == name;
        let indexes: Vec<_> = (0..self.topics.list.len()).filter(named).collect();
        if indexes.is_empty() {
            return Err(ArchiveError::NoSuchTopic {
                path: self.path.clone(),
                topic: name.to_owned(),
                known: self.topic_names(),
            });
        }
        Ok(indexes)
    }

    fn topic_names(&self) -> Vec<String> {
        self.topics()
            .iter()
            .map(|topic| topic.name.clone())
            .collect()
    }
}
