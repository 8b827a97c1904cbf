//! Reading bags of ROS 1, version 2.0 (<http://wiki.ros.org/Bags/Format/2.0>), chunk by chunk.
//!
//! [`Ros1Bag::read`] finds the contents of the bag from the index at its end if that is sound, and otherwise by
//! reading all of it. A declared size is checked against the file and a limit before memory is allocated.

mod chunk;
mod cursor;
mod index;
mod record;
mod scan;

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use crate::topic::{Topic, Topics};
pub(crate) use cursor::ros1_cursor;
use record::{Header, Records, Step, op};

/// First bytes of a bag of any version.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V";
/// First bytes of a bag of version 2.0.
const VERSION: &[u8] = b"#ROSBAG V2.0\n";
/// Longest record other than a chunk that is read \[bytes\].
/// Resolution: bounds memory.
const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Maximum number of connections (publishers of a topic) of a bag.
/// Resolution: bounds time; a robot has some hundreds.
const MAX_CONNECTIONS: usize = 4096;
/// Maximum number of chunks of a bag.
/// Resolution: bounds memory; with rosbag's chunks of 768 KiB it is 3 TiB.
const MAX_CHUNKS: usize = 4 << 20;
/// Maximum number of damages reported for a bag.
/// Resolution: bounds memory.
const MAX_DAMAGES: usize = 1000;

/// Contents of a bag, with their positions.
#[derive(Debug)]
pub(crate) struct Ros1Bag {
    pub(crate) path: PathBuf,
    pub(crate) file_bytes: u64,
    connections: BTreeMap<u32, Connection>,
    chunks: Vec<Chunk>,
    /// Log times of the first and the last message.
    pub(crate) log_times_ns: Option<(i64, i64)>,
    pub(crate) damage: Vec<Damage>,
}

/// A publisher of a topic.
#[derive(Debug)]
struct Connection {
    topic: String,
    type_name: String,
    md5sum: String,
    message_count: u64,
}

/// Position, time range and connections of a chunk.
#[derive(Debug)]
struct Chunk {
    /// File offset of its record.
    at: u64,
    start_ns: u64,
    end_ns: u64,
    /// Connections with messages in it.
    connections: Vec<u32>,
    /// Whether the file ends within it.
    torn: bool,
}

impl Ros1Bag {
    /// Reads the contents of the bag at `path`.
    ///
    /// # Errors
    /// If it cannot be opened, or its first record is malformed.
    pub(crate) fn read(path: &Path) -> Result<Self, ArchiveError> {
        let unreadable = |reason| ArchiveError::Unreadable {
            path: path.to_owned(),
            reason,
        };
        let mut bag = Self {
            path: path.to_owned(),
            file_bytes: 0,
            connections: BTreeMap::new(),
            chunks: Vec::new(),
            log_times_ns: None,
            damage: Vec::new(),
        };
        let file = File::open(path).map_err(ArchiveError::io(path))?;
        let head = bag.read_from(file).map_err(ArchiveError::io(path))?;
        head.map_err(unreadable)?;
        Ok(bag)
    }

    /// Reads the contents of `file`. The inner error is the reason why its beginning is invalid.
    fn read_from(&mut self, file: File) -> io::Result<Result<(), String>> {
        self.file_bytes = file.metadata()?.len();
        let mut records = Records::new(file, self.file_bytes);
        let mut version = Vec::new();
        records.read(VERSION.len() as u64, &mut version)?;
        if version != VERSION {
            let version = String::from_utf8_lossy(&version);
            let version = version.trim_start_matches('#').trim_end();
            return Ok(Err(format!(
                "it is a {version:?}, and only version 2.0 can be read: `rosbag fix` of ROS 1 makes one of it"
            )));
        }
        let head = match records.step()? {
            Step::Record(head) => head,
            Step::Torn { .. } | Step::End => {
                return Ok(Err("the file ends within its header".to_owned()));
            }
            Step::Nonsense { reason, .. } => return Ok(Err(reason)),
        };
        let header = Header(&head.header);
        let (Some(op::BAG_HEADER), Some(index_at)) = (header.op(), header.u64("index_pos")) else {
            return Ok(Err("its first record is not the header of a bag".to_owned()));
        };
        let counts = (header.u32("conn_count"), header.u32("chunk_count"));
        let data_at = head.data_at + head.data_len;
        let flaw = if index_at == 0 {
            "its recorder did not close the bag".to_owned()
        } else {
            match index::read(self, &mut records, index_at, counts)? {
                Ok(()) => return Ok(Ok(())),
                Err(reason) => reason,
            }
        };
        self.connections.clear();
        self.chunks.clear();
        self.log_times_ns = None;
        records.go_to(data_at)?;
        let torn = scan::read(self, &mut records)?;
        if !torn {
            self.damage(index_at, DamageKind::Index { reason: flaw });
        }
        Ok(Ok(()))
    }

    /// Returns the number of chunks.
    pub(crate) fn chunks(&self) -> u64 {
        self.chunks.len() as u64
    }

    /// Returns the topics, and the index of the topic of each connection.
    pub(crate) fn topics(&self) -> (Topics, BTreeMap<u32, usize>) {
        let mut topics = Topics::default();
        let places = self.connections.iter().map(|(&number, connection)| {
            let place = topics.add_stored(connection.as_topic(), &connection.md5sum);
            (number, place)
        });
        let places = places.collect();
        (topics, places)
    }

    /// Adds a connection from its record. The error is the reason why the record is invalid.
    fn connect(&mut self, header: Header<'_>, data: &[u8]) -> Result<(), String> {
        let number = header.u32("conn").ok_or("a connection without a number")?;
        let text =
            |bytes: Option<&[u8]>| String::from_utf8_lossy(bytes.unwrap_or_default()).into_owned();
        let of = Header(data);
        if self.connections.contains_key(&number) {
            return Ok(());
        }
        if self.connections.len() == MAX_CONNECTIONS {
            return Err(format!(
                "more than {MAX_CONNECTIONS} connections, which is the limit"
            ));
        }
        // The header has the topic after remapping, the data have the name in the publisher's code.
        let topic = header.get("topic").or_else(|| of.get("topic"));
        let connection = Connection {
            topic: text(topic),
            type_name: text(of.get("type")),
            md5sum: text(of.get("md5sum")),
            message_count: 0,
        };
        self.connections.insert(number, connection);
        Ok(())
    }

    /// Adds a chunk, with its number of messages by connection.
    fn add(&mut self, chunk: Chunk, counts: &BTreeMap<u32, u64>) -> Result<(), String> {
        if self.chunks.len() == MAX_CHUNKS {
            return Err(format!("more than {MAX_CHUNKS} chunks, which is the limit"));
        }
        for (number, count) in counts {
            if let Some(connection) = self.connections.get_mut(number) {
                connection.message_count = connection.message_count.saturating_add(*count);
            }
        }
        if !counts.is_empty() {
            let (start_ns, end_ns) = (chunk.start_ns as i64, chunk.end_ns as i64);
            let (from, to) = self.log_times_ns.unwrap_or((start_ns, end_ns));
            self.log_times_ns = Some((from.min(start_ns), to.max(end_ns)));
        }
        self.chunks.push(chunk);
        Ok(())
    }

    fn damage(&mut self, at: u64, kind: DamageKind) {
        if self.damage.len() < MAX_DAMAGES {
            let readable_until_ns = self.log_times_ns.map(|(_, end_ns)| end_ns);
            self.damage.push(Damage {
                path: self.path.clone(),
                at,
                kind,
                readable_until_ns,
            });
        }
    }
}

impl Connection {
    fn as_topic(&self) -> Topic {
        Topic {
            name: self.topic.clone(),
            type_name: self.type_name.clone(),
            message_encoding: "ros1".to_owned(),
            type_hash: None,
            offered_qos: None,
            message_count: self.message_count,
        }
    }
}
