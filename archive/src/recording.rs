//! A recording, whatever its format.

mod joint_states;
mod messages;
mod topic;

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use crate::ArchiveError;
use crate::csv_file::{self, CsvMapping, CsvTable};
use crate::damage::Damage;
use crate::mcap_file::{Layout, McapCursor, Order};
use crate::ros::{self, Message as _};

pub use joint_states::{JointStates, Stamped};
pub(crate) use messages::{Cursor, RawMessage};
pub use messages::{Message, Messages};
pub use topic::Topic;
use topic::Topics;

/// What a recording is stored as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingKind {
    /// One MCAP file.
    Mcap,
    /// A table of numbers.
    Csv,
}

impl std::fmt::Display for RecordingKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Mcap => "MCAP file",
            Self::Csv => "CSV table",
        })
    }
}

/// A recording that has been opened: what is in it is known, its messages are not read yet.
pub struct Recording {
    path: PathBuf,
    topics: Arc<Topics>,
    log_times_ns: Option<(i64, i64)>,
    damage: Vec<Damage>,
    store: Store,
}

enum Store {
    Mcap(Arc<Layout>),
    Csv(Box<CsvTable>),
}

impl Recording {
    /// Opens the recording at `path`: an MCAP file.
    ///
    /// Reads the index only, if the recording has a sound one; else all of it, once.
    ///
    /// # Errors
    /// [`ArchiveError::Io`], [`ArchiveError::UnknownFormat`] and [`ArchiveError::Unreadable`]. A
    /// recording that can be read in part is no error; see [`Recording::damage`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ArchiveError> {
        let path = path.as_ref();
        let mut beginning = Vec::new();
        File::open(path)
            .and_then(|file| file.take(16).read_to_end(&mut beginning))
            .map_err(ArchiveError::io(path))?;
        if beginning.starts_with(mcap::MAGIC) {
            return Ok(Self::from_mcap(Layout::read(path)?));
        }
        Err(ArchiveError::UnknownFormat {
            path: path.to_owned(),
            reason: "it begins as neither an MCAP file nor a SQLite database does".to_owned(),
        })
    }

    /// Opens the table at `path`, with `joints` as the names that its columns stand for unless the
    /// mapping has its own. Its rows appear as joint states on the topic `/joint_states`.
    ///
    /// All of it is read and checked, once.
    ///
    /// # Errors
    /// [`ArchiveError::Io`]; [`ArchiveError::CsvMapping`] if the mapping does not fit the table;
    /// [`ArchiveError::Csv`] with the first line that makes no sense.
    pub fn open_csv(
        path: impl AsRef<Path>,
        mapping: &CsvMapping,
        joints: &[String],
    ) -> Result<Self, ArchiveError> {
        let path = path.as_ref();
        let table = CsvTable::check(path, mapping, joints)?;
        let mut topics = Topics::default();
        topics.add(Topic {
            name: csv_file::TOPIC.to_owned(),
            type_name: ros::JointState::TYPE.to_owned(),
            message_encoding: "cdr".to_owned(),
            type_hash: Some(ros::JointState::TYPE_HASH.to_owned()),
            message_count: table.rows,
        });
        Ok(Self {
            path: path.to_owned(),
            topics: Arc::new(topics),
            log_times_ns: table.times_ns,
            damage: table.damage.clone(),
            store: Store::Csv(Box::new(table)),
        })
    }

    fn from_mcap(layout: Layout) -> Self {
        let topics = Topics::of_mcap(&layout);
        let time = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
        Self {
            path: layout.path.clone(),
            topics: Arc::new(topics),
            log_times_ns: layout
                .log_times
                .map(|(start, end)| (time(start), time(end))),
            damage: layout.damage.clone(),
            store: Store::Mcap(Arc::new(layout)),
        }
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it is stored as.
    pub fn kind(&self) -> RecordingKind {
        match self.store {
            Store::Mcap(_) => RecordingKind::Mcap,
            Store::Csv(_) => RecordingKind::Csv,
        }
    }

    /// Its topics, with their types and message counts.
    pub fn topics(&self) -> &[Topic] {
        &self.topics.list
    }

    /// Log time of the first message \[ns since the epoch\]; `None` if it is empty.
    pub fn start_ns(&self) -> Option<i64> {
        self.log_times_ns.map(|(start_ns, _)| start_ns)
    }

    /// Log time of the last message \[ns since the epoch\]; `None` if it is empty.
    pub fn end_ns(&self) -> Option<i64> {
        self.log_times_ns.map(|(_, end_ns)| end_ns)
    }

    /// Messages that can be read, over all topics.
    pub fn message_count(&self) -> u64 {
        self.topics().iter().map(|topic| topic.message_count).sum()
    }

    /// What is known by now to be unreadable. A broken chunk in a file with a sound index is found
    /// only when it is read, and told by [`Messages`] then.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// The topic `name`, which must carry messages of type `M` as CDR, and at least one.
    ///
    /// # Errors
    /// [`ArchiveError::Empty`], [`ArchiveError::NoSuchTopic`], [`ArchiveError::WrongType`] or
    /// [`ArchiveError::NoMessages`].
    pub fn topic_of<M: ros::Message>(&self, name: &str) -> Result<&Topic, ArchiveError> {
        if self.message_count() == 0 {
            return Err(ArchiveError::Empty {
                path: self.path.clone(),
                known: self.topic_names(),
            });
        }
        let index = self.topic_indexes(name)?[0];
        let topic = &self.topics.list[index];
        if topic.type_name != M::TYPE || topic.message_encoding != "cdr" {
            return Err(ArchiveError::WrongType {
                path: self.path.clone(),
                topic: name.to_owned(),
                found: format!("{} as {:?}", topic.type_name, topic.message_encoding),
                expected: format!("{} as \"cdr\"", M::TYPE),
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

    /// The messages of these topics in the order of their log times.
    ///
    /// # Errors
    /// [`ArchiveError::NoSuchTopic`], or if the recording can no longer be opened.
    pub fn messages(&self, topics: &[&str]) -> Result<Messages, ArchiveError> {
        let mut wanted = vec![false; self.topics.list.len()];
        for name in topics {
            for index in self.topic_indexes(name)? {
                wanted[index] = true;
            }
        }
        self.read(&wanted)
    }

    /// All messages in the order of their log times.
    ///
    /// # Errors
    /// If the recording can no longer be opened.
    pub fn all_messages(&self) -> Result<Messages, ArchiveError> {
        self.read(&vec![true; self.topics.list.len()])
    }

    /// The joint states on `topic`, decoded, in the order of their log times.
    ///
    /// # Errors
    /// As [`Recording::topic_of`] and [`Recording::messages`].
    pub fn joint_states(&self, topic: &str) -> Result<JointStates, ArchiveError> {
        self.topic_of::<ros::JointState>(topic)?;
        Ok(JointStates::new(self.messages(&[topic])?))
    }

    fn read(&self, wanted: &[bool]) -> Result<Messages, ArchiveError> {
        Ok(Messages::new(
            &self.path,
            Arc::clone(&self.topics),
            self.cursor(wanted)?,
        ))
    }

    /// Over the topics marked in `wanted`, by their place in [`Recording::topics`].
    fn cursor(&self, wanted: &[bool]) -> Result<Box<dyn Cursor>, ArchiveError> {
        match &self.store {
            Store::Mcap(layout) => {
                let topic = |channel| {
                    let topic = self.topics.of_channel(channel)?;
                    wanted[topic].then_some(topic)
                };
                let cursor = McapCursor::new(Arc::clone(layout), Order::LogTime, topic)?;
                Ok(Box::new(cursor))
            }
            Store::Csv(table) => Ok(Box::new(table.cursor()?)),
        }
    }

    /// All topics of that name: publishers may disagree on the type.
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
