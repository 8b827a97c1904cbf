//! What an MCAP file holds, and where.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use mcap::records::{Channel, Metadata, Record, op};

use super::chunk::MessageHeader;
use super::{index, scan};
use crate::ArchiveError;
use crate::damage::{Damage, DamageKind};

/// Where messages lie.
#[derive(Debug, Clone)]
pub(super) struct Extent {
    /// Place of the first record's opcode.
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
    /// The last chunk, torn off within.
    TornChunk,
    /// Records that lie in the file without a chunk around them.
    Plain,
}

/// How the messages of a channel are to be read.
#[derive(Debug, Clone)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
}

/// What an MCAP file holds, and where.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) path: PathBuf,
    pub(crate) file_bytes: u64,
    /// Whether the first record could be read.
    header_read: bool,
    pub(crate) profile: String,
    pub(crate) library: String,
    pub(crate) schemas: BTreeMap<u16, Schema>,
    pub(crate) channels: BTreeMap<u16, Channel>,
    /// Messages by channel.
    pub(crate) counts: BTreeMap<u16, u64>,
    /// Least and greatest log time.
    pub(crate) log_times: Option<(u64, u64)>,
    pub(crate) metadata: Vec<Metadata>,
    /// Place and length of each attachment's record body.
    pub(crate) attachments: Vec<(u64, u64)>,
    pub(crate) damage: Vec<Damage>,
    pub(super) extents: Vec<Extent>,
}

impl Layout {
    /// Reads the index of the file, or the whole file if it has none that is sound.
    ///
    /// # Errors
    /// If it cannot be opened, or not even its first record can be read.
    pub(crate) fn read(path: &Path) -> Result<Self, ArchiveError> {
        let file = File::open(path).map_err(ArchiveError::io(path))?;
        let file_bytes = file.metadata().map_err(ArchiveError::io(path))?.len();
        check_magic(&file, path)?;
        let mut layout = Self::empty(path, file_bytes);
        match index::read(&file, &mut layout).map_err(ArchiveError::io(path))? {
            index::Outcome::Complete => return layout.checked(),
            index::Outcome::Absent => layout = Self::empty(path, file_bytes),
            index::Outcome::Unsound { at, reason } => {
                layout = Self::empty(path, file_bytes);
                layout.damage(at, DamageKind::Index { reason });
            }
        }
        scan::read(&file, &mut layout).map_err(ArchiveError::io(path))?;
        // Of a file that is torn within its data, that it has no index goes without saying.
        let torn = |damage: &Damage| damage.kind == DamageKind::TornTail;
        if layout.damage.iter().any(torn) {
            layout
                .damage
                .retain(|damage| !matches!(damage.kind, DamageKind::Index { .. }));
        }
        layout.checked()
    }

    fn empty(path: &Path, file_bytes: u64) -> Self {
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
        }
    }

    /// A layout of which at least the first record could be read.
    fn checked(self) -> Result<Self, ArchiveError> {
        if self.header_read {
            return Ok(self);
        }
        let reason = self.damage.first().map(|damage| damage.kind.to_string());
        Err(ArchiveError::Unreadable {
            reason: reason.unwrap_or_else(|| "it has no header".to_owned()),
            path: self.path,
        })
    }

    pub(super) fn damage(&mut self, at: u64, kind: DamageKind) {
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

    /// Takes in a schema, channel, metadata or header record; others are passed over.
    ///
    /// # Errors
    /// Why the record makes no sense, in words.
    pub(super) fn take_in(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        if !matches!(opcode, op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA) {
            return Ok(());
        }
        match mcap::parse_record(opcode, body).map_err(|error| words(&error))? {
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
                self.channels.entry(channel.id).or_insert(channel);
            }
            Record::Metadata(metadata) => self.metadata.push(metadata),
            _ => {}
        }
        Ok(())
    }
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

fn check_magic(file: &File, path: &Path) -> Result<(), ArchiveError> {
    let mut magic = Vec::new();
    file.take(mcap::MAGIC.len() as u64)
        .read_to_end(&mut magic)
        .map_err(ArchiveError::io(path))?;
    if magic == mcap::MAGIC {
        return Ok(());
    }
    Err(ArchiveError::Unreadable {
        path: path.to_owned(),
        reason: "it does not begin as an MCAP file does".to_owned(),
    })
}
