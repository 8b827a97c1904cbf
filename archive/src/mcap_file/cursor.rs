//! The messages of an MCAP file one after the other.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::ops::RangeInclusive;
use std::sync::Arc;

use mcap::records::op;

use super::chunk::{Unpacker, inner_records};
use super::layout::{Extent, ExtentKind, Layout};
use super::{MAX_LOADED_BYTES, MESSAGE_HEADER_BYTES, RECORD_PREFIX_BYTES};
use crate::cursor::{Cursor, RawMessage};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;

/// In which order messages come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// By log time; of equal ones, the earlier in the file first.
    LogTime,
    /// As they lie in the file.
    File,
}

pub(crate) struct McapCursor {
    layout: Arc<Layout>,
    file: File,
    order: Order,
    /// What the owner calls each channel; `None` if it is not wanted.
    topic_by_channel: Vec<Option<usize>>,
    /// Extents with wanted channels, in the order they are needed.
    extents: Vec<usize>,
    next_extent: usize,
    loaded: Vec<Loaded>,
    /// Index into `loaded` of the message that was given last.
    current: Option<usize>,
    /// Log time of the message that was given last.
    given_until_ns: Option<u64>,
    /// Told before anything else is given.
    damage: Vec<Damage>,
    unpacker: Unpacker,
    packed: Vec<u8>,
    /// Memory of extents that are done with.
    spare: Option<Loaded>,
}

/// An extent in memory.
#[derive(Default)]
struct Loaded {
    file_at: u64,
    records: Vec<u8>,
    /// The wanted messages in the order they are to be given.
    messages: Vec<Entry>,
    /// How many have been given.
    given: usize,
}

#[derive(Clone, Copy)]
struct Entry {
    log_time: u64,
    publish_time: u64,
    sequence: u32,
    topic: u32,
    body_at: usize,
    body_len: usize,
}

impl McapCursor {
    /// Over the channels to which `topic` gives a number.
    pub(crate) fn new(
        layout: Arc<Layout>,
        order: Order,
        topic: impl Fn(u16) -> Option<usize>,
    ) -> Result<Self, ArchiveError> {
        let file = File::open(&layout.path).map_err(ArchiveError::io(&layout.path))?;
        let channels = layout
            .channels
            .keys()
            .max()
            .map_or(0, |&id| id as usize + 1);
        let topic_by_channel: Vec<_> = (0..channels)
            .map(|id| u16::try_from(id).ok())
            .map(|id| {
                id.filter(|id| layout.channels.contains_key(id))
                    .and_then(&topic)
            })
            .collect();
        let wanted = |extent: &Extent| {
            let wanted = |&id: &u16| {
                // A channel that nobody declared is damage to be told.
                topic_by_channel
                    .get(id as usize)
                    .is_none_or(Option::is_some)
            };
            extent.channels.is_empty() || extent.channels.iter().any(wanted)
        };
        let mut extents: Vec<_> = (0..layout.extents.len())
            .filter(|&i| wanted(&layout.extents[i]))
            .collect();
        extents.sort_by_key(|&i| {
            let extent = &layout.extents[i];
            match order {
                Order::LogTime => (extent.start_ns, extent.at),
                Order::File => (0, extent.at),
            }
        });
        let unpacker = Unpacker::new().map_err(ArchiveError::io(&layout.path))?;
        Ok(Self {
            file,
            order,
            topic_by_channel,
            extents,
            next_extent: 0,
            loaded: Vec::new(),
            current: None,
            given_until_ns: None,
            damage: Vec::new(),
            unpacker,
            packed: Vec::new(),
            spare: None,
            layout,
        })
    }

    /// Without the extents that hold nothing of these log times \[ns since the epoch\]; those at the edges hold more.
    pub(crate) fn within(mut self, within_ns: &RangeInclusive<i64>) -> Self {
        let of = |ns: i64| u64::try_from(ns).unwrap_or(0);
        let (from_ns, to_ns) = (of(*within_ns.start()), of(*within_ns.end()));
        let extents = &self.layout.extents;
        self.extents
            .retain(|&i| extents[i].start_ns <= to_ns && extents[i].end_ns >= from_ns);
        self
    }

    /// The loaded extent whose next message comes first.
    fn first(&self) -> Option<(usize, u64)> {
        let head = |loaded: &Loaded| loaded.messages[loaded.given];
        (0..self.loaded.len())
            .min_by_key(|&i| {
                let loaded = &self.loaded[i];
                (head(loaded).log_time, loaded.file_at)
            })
            .map(|i| (i, head(&self.loaded[i]).log_time))
    }

    fn load(&mut self, extent: usize) -> Result<(), ArchiveError> {
        let layout = Arc::clone(&self.layout);
        let extent = &layout.extents[extent];
        let mut loaded = self.spare.take().unwrap_or_default();
        loaded.file_at = extent.at;
        if let Err(reason) = self.read(extent, &mut loaded.records)? {
            let time = |ns| i64::try_from(ns).ok();
            self.damage.push(self.damage(
                extent,
                DamageKind::Chunk {
                    reason,
                    start_ns: time(extent.start_ns),
                    end_ns: time(extent.end_ns),
                },
            ));
            self.spare = Some(loaded);
            return Ok(());
        }
        self.list(extent, &mut loaded);
        if loaded.messages.is_empty() {
            self.spare = Some(loaded);
            return Ok(());
        }
        self.loaded.push(loaded);
        let bytes: usize = self.loaded.iter().map(|loaded| loaded.records.len()).sum();
        if self.loaded.len() > 1 && bytes > MAX_LOADED_BYTES {
            return Err(ArchiveError::TooMuchOverlap {
                path: layout.path.clone(),
                log_time_ns: i64::try_from(extent.start_ns).unwrap_or(i64::MAX),
                loaded: bytes,
                limit: MAX_LOADED_BYTES,
            });
        }
        Ok(())
    }

    /// The records of `extent`, or in words why they cannot be had.
    fn read(
        &mut self,
        extent: &Extent,
        records: &mut Vec<u8>,
    ) -> Result<Result<(), String>, ArchiveError> {
        let into = match extent.kind {
            ExtentKind::Plain => &mut *records,
            ExtentKind::Chunk | ExtentKind::TornChunk => &mut self.packed,
        };
        into.clear();
        if extent.len > MAX_LOADED_BYTES as u64 {
            return Ok(Err(format!(
                "{} bytes, the limit is {MAX_LOADED_BYTES}",
                extent.len
            )));
        }
        let path = &self.layout.path;
        self.file
            .seek(SeekFrom::Start(extent.at))
            .map_err(ArchiveError::io(path))?;
        let read = (&self.file)
            .take(extent.len)
            .read_to_end(into)
            .map_err(ArchiveError::io(path))? as u64;
        if read < extent.len {
            return Ok(Err(format!("{read} bytes left of {}", extent.len)));
        }
        if extent.kind == ExtentKind::Plain {
            return Ok(Ok(()));
        }
        let Some((prefix, body)) = self
            .packed
            .split_first_chunk::<{ RECORD_PREFIX_BYTES as usize }>()
        else {
            return Ok(Err(format!("{read} bytes")));
        };
        if extent.kind == ExtentKind::TornChunk {
            Unpacker::unpack_torn(body, records);
            return Ok(Ok(()));
        }
        let [opcode, len @ ..] = *prefix;
        if opcode != op::CHUNK || u64::from_le_bytes(len) != body.len() as u64 {
            return Ok(Err("the index leads to something else".to_owned()));
        }
        Ok(self.unpacker.unpack(body, records))
    }

    /// Lists the wanted messages of an extent in the order they are to be given.
    fn list(&mut self, extent: &Extent, loaded: &mut Loaded) {
        loaded.messages.clear();
        loaded.given = 0;
        let mut flaw = None;
        for record in inner_records(&loaded.records) {
            let Ok(record) = record else {
                if extent.kind != ExtentKind::TornChunk {
                    flaw = Some("a record in the chunk is cut short".to_owned());
                }
                break;
            };
            let Some(message) = record.message() else {
                if record.opcode == op::MESSAGE {
                    flaw = Some(format!("message of {} bytes", record.body.len()));
                }
                continue;
            };
            if !self.layout.channels.contains_key(&message.channel) {
                flaw = Some(format!("message on undeclared channel {}", message.channel));
                continue;
            }
            if message.log_time.max(message.publish_time) > i64::MAX as u64 {
                flaw = Some(format!("message at {} ns", message.log_time));
                continue;
            }
            let Some(topic) = self.topic_by_channel[message.channel as usize] else {
                continue;
            };
            loaded.messages.push(Entry {
                log_time: message.log_time,
                publish_time: message.publish_time,
                sequence: message.sequence,
                topic: topic as u32,
                body_at: record.at + MESSAGE_HEADER_BYTES,
                body_len: record.body.len() - MESSAGE_HEADER_BYTES,
            });
        }
        if self.order == Order::LogTime && !loaded.messages.is_sorted_by_key(|m| m.log_time) {
            loaded.messages.sort_by_key(|message| message.log_time);
        }
        if let Some(reason) = flaw {
            self.damage
                .push(self.damage(extent, DamageKind::Record { reason }));
        }
    }

    fn damage(&self, extent: &Extent, kind: DamageKind) -> Damage {
        Damage {
            path: self.layout.path.clone(),
            at: extent.at,
            kind,
            readable_until_ns: self.given_until_ns.and_then(|ns| i64::try_from(ns).ok()),
        }
    }
}

impl Cursor for McapCursor {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        if let Some(i) = self.current.take() {
            let loaded = &mut self.loaded[i];
            loaded.given += 1;
            if loaded.given == loaded.messages.len() {
                self.spare = Some(self.loaded.swap_remove(i));
            }
        }
        loop {
            if !self.damage.is_empty() {
                return Err(ArchiveError::Damaged(self.damage.remove(0)));
            }
            let first = self.first();
            let next = self.extents.get(self.next_extent).copied();
            let load = match (first, next) {
                (_, None) => None,
                (None, next) => next,
                (Some(_), Some(_)) if self.order == Order::File => None,
                (Some((_, log_time)), Some(next)) => {
                    (self.layout.extents[next].start_ns <= log_time).then_some(next)
                }
            };
            let Some(extent) = load else {
                self.current = first.map(|(i, _)| i);
                self.given_until_ns = first.map(|(_, log_time)| log_time).or(self.given_until_ns);
                return Ok(self.current.is_some());
            };
            self.next_extent += 1;
            self.load(extent)?;
        }
    }

    fn current(&self) -> Option<RawMessage<'_>> {
        let loaded = &self.loaded[self.current?];
        let message = loaded.messages[loaded.given];
        Some(RawMessage {
            topic: message.topic as usize,
            log_time_ns: message.log_time as i64,
            publish_time_ns: message.publish_time as i64,
            sequence: message.sequence,
            at: loaded.file_at,
            body: &loaded.records[message.body_at..message.body_at + message.body_len],
        })
    }

    fn chunks_read(&self) -> u64 {
        self.next_extent as u64
    }
}
