//! Contents of an MCAP file, with their positions.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::{Channel, Metadata, Record, op};

use super::chunk::MessageHeader;
use crate::damage::{Damage, DamageKind};
use crate::fields::Fields;
use crate::topic::{Topic, Topics};

/// Maximum number of damages reported for a file.
/// Resolution: bounds memory.
const MAX_DAMAGES: usize = 1000;
/// Maximum number of channels of a file.
/// Resolution: bounds time; a robot has some hundreds.
const MAX_CHANNELS: usize = 4096;
/// Maximum total size of the schemas, channels and metadata of a file \[bytes\].
/// Resolution: bounds memory.
const MAX_KEPT_BYTES: u64 = 256 << 20;

/// A contiguous range of a file that contains messages.
#[derive(Debug, Clone)]
pub(super) struct Extent {
    /// File offset of the first record's opcode.
    pub(super) at: u64,
    /// Length of all records with their prefixes.
    pub(super) len: u64,
    /// Log times of the first and the last message.
    pub(super) start_ns: u64,
    pub(super) end_ns: u64,
    /// Channels with messages in it; empty if that is not known.
    pub(super) channels: Box<[u16]>,
    pub(super) kind: ExtentKind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum ExtentKind {
    /// One chunk record.
    Chunk,
    /// The last chunk, truncated.
    TornChunk,
    /// Records outside chunks.
    Plain,
}

/// Schema of the messages of a channel.
#[derive(Debug, Clone)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
}

/// Contents of an MCAP file, with their positions.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) path: PathBuf,
    pub(crate) file_bytes: u64,
    /// Whether the first record could be read.
    pub(super) header_read: bool,
    pub(crate) profile: String,
    pub(crate) library: String,
    pub(crate) schemas: BTreeMap<u16, Schema>,
    pub(crate) channels: BTreeMap<u16, Channel>,
    /// Messages by channel.
    pub(crate) counts: BTreeMap<u16, u64>,
    /// Least and greatest log time.
    pub(crate) log_times: Option<(u64, u64)>,
    pub(crate) metadata: Vec<Metadata>,
    /// Offset and length of each attachment's record body.
    pub(crate) attachments: Vec<(u64, u64)>,
    pub(crate) damage: Vec<Damage>,
    pub(super) extents: Vec<Extent>,
    /// Total length of the records kept \[bytes\].
    kept_bytes: u64,
}

impl Layout {
    /// Returns the number of chunks and of runs of messages outside chunks.
    pub(crate) fn chunks(&self) -> u64 {
        self.extents.len() as u64
    }

    pub(super) fn empty(path: &Path, file_bytes: u64) -> Self {
        Self {
            path: path.to_owned(),
            file_bytes,
            header_read: false,
            profile: String::new(),
            library: String::new(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            counts: BTreeMap::new(),
            log_times: None,
            metadata: Vec::new(),
            attachments: Vec::new(),
            damage: Vec::new(),
            extents: Vec::new(),
            kept_bytes: 0,
        }
    }

    /// Returns the topics with their channels.
    pub(crate) fn topics(&self) -> Topics {
        let mut topics = Topics::default();
        for (&id, channel) in &self.channels {
            let schema = self.schemas.get(&channel.schema_id);
            let topic = Topic {
                name: channel.topic.clone(),
                type_name: schema.map_or_else(String::new, |schema| schema.name.clone()),
                message_encoding: channel.message_encoding.clone(),
                type_hash: channel.metadata.get("topic_type_hash").cloned(),
                offered_qos: channel.metadata.get("offered_qos_profiles").cloned(),
                message_count: self.counts.get(&id).copied().unwrap_or(0),
            };
            let md5sum = channel.metadata.get("md5sum").map_or("", String::as_str);
            topics.add_channel(id, topic, md5sum);
        }
        topics
    }

    /// Records a damage, unless [`MAX_DAMAGES`] are recorded.
    pub(super) fn damage(&mut self, at: u64, kind: DamageKind) {
        if self.damage.len() >= MAX_DAMAGES {
            return;
        }
        self.damage.push(Damage {
            path: self.path.clone(),
            at,
            kind,
            readable_until_ns: self
                .log_times
                .and_then(|(_, end_ns)| i64::try_from(end_ns).ok()),
        });
    }

    /// Counts a message and widens the times.
    pub(super) fn count(&mut self, message: &MessageHeader) {
        *self.counts.entry(message.channel).or_default() += 1;
        self.widen(message.log_time, message.log_time);
    }

    pub(super) fn widen(&mut self, start_ns: u64, end_ns: u64) {
        self.log_times = Some(match self.log_times {
            Some((start, end)) => (start.min(start_ns), end.max(end_ns)),
            None => (start_ns, end_ns),
        });
    }

    /// Stores a schema, channel, metadata or header record, and ignores others.
    ///
    /// # Errors
    /// The reason why the record is invalid.
    pub(super) fn take_in(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if !matches!(opcode, op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA) {
            return Ok(());
        }
        self.kept_bytes += body.len() as u64;
        if self.kept_bytes > MAX_KEPT_BYTES {
            return Err(format!(
                "schemas, channels and metadata of more than {MAX_KEPT_BYTES} bytes, which is the limit"
            ));
        }
        match parse(opcode, body)? {
            Record::Header(header) => {
                self.header_read = true;
                self.profile = header.profile;
                self.library = header.library;
            }
            Record::Schema { header, data } => {
                self.schemas.entry(header.id).or_insert_with(|| Schema {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                });
            }
            Record::Channel(channel) => {
                if self.channels.len() >= MAX_CHANNELS && !self.channels.contains_key(&channel.id) {
                    return Err(format!(
                        "more than {MAX_CHANNELS} channels, which is the limit"
                    ));
                }
                self.channels.entry(channel.id).or_insert(channel);
            }
            Record::Metadata(metadata) => self.metadata.push(metadata),
            _ => {}
        }
        Ok(())
    }
}

/// Parses a record, after checking that its texts end within it.
///
/// # Errors
/// The reason why the record is invalid.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Result<Record<'_>, String> {
    // The mcap crate allocates the declared length of a text before it checks that the record contains it.
    if !lengths_fit(opcode, body) {
        return Err("a text that reaches beyond its record".to_owned());
    }
    mcap::parse_record(opcode, body).map_err(|error| words(&error))
}

/// Whether the texts and the data of a record end within it.
fn lengths_fit(opcode: u8, body: &[u8]) -> bool {
    let mut fields = Fields(body);
    let fit = match opcode {
        op::HEADER => texts(&mut fields, 2),
        op::SCHEMA => fields
            .take(2)
            .and_then(|_| texts(&mut fields, 2))
            .and_then(|()| texts(&mut fields, 1)),
        op::CHANNEL => fields
            .take(4)
            .and_then(|_| texts(&mut fields, 2))
            .and_then(|()| text_map(&mut fields)),
        op::METADATA => texts(&mut fields, 1).and_then(|()| text_map(&mut fields)),
        // Times, place and length of the chunk, then the place of each channel's index.
        op::CHUNK_INDEX => fields
            .take(32)
            .and_then(|_| texts(&mut fields, 1))
            .and_then(|()| fields.take(8))
            .and_then(|_| texts(&mut fields, 1)),
        _ => Some(()),
    };
    fit.is_some()
}

fn texts(fields: &mut Fields<'_>, count: usize) -> Option<()> {
    for _ in 0..count {
        let len = fields.u32()? as usize;
        fields.take(len)?;
    }
    Some(())
}

fn text_map(fields: &mut Fields<'_>) -> Option<()> {
    let len = fields.u32()? as usize;
    let mut entries = Fields(fields.take(len)?);
    while !entries.0.is_empty() {
        texts(&mut entries, 2)?;
    }
    Some(())
}

/// An error of the mcap crate with its cause, in one line.
pub(super) fn words(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(error.to_string().lines().next().unwrap_or_default());
        cause = error.source();
    }
    text
}
