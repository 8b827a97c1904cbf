//! Sequential access to the messages of an MCAP file.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::sync::Arc;

use mcap::records::op;

use super::chunk::{Unpacker, inner_records};
use super::layout::{Extent, ExtentKind, Layout};
use super::{MESSAGE_HEADER_BYTES, RECORD_PREFIX_BYTES};
use crate::chunks::{ChunkCursor, Chunks, Entry, Loaded, MAX_LOADED_BYTES, Order, Place, too_long};
use crate::damage::DamageKind;
use crate::error::ArchiveError;

pub(crate) type McapCursor = ChunkCursor<McapChunks>;

/// Loader of the extents of a file.
pub(crate) struct McapChunks {
    layout: Arc<Layout>,
    file: File,
    /// The caller's topic number of each channel; `None` if it is not selected.
    topic_by_channel: Vec<Option<usize>>,
    unpacker: Unpacker,
    packed: Vec<u8>,
}

/// Creates a cursor over the channels for which `topic` returns a number.
pub(crate) fn mcap_cursor(
    layout: Arc<Layout>,
    order: Order,
    topic: impl Fn(u16) -> Option<usize>,
) -> Result<McapCursor, ArchiveError> {
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
            // An extent with an undeclared channel is loaded, because loading it reports the damage.
            topic_by_channel
                .get(id as usize)
                .is_none_or(Option::is_some)
        };
        // Without a list of its channels, an extent may hold any of them.
        extent.channels.is_empty() || extent.channels.iter().any(wanted)
    };
    let extents = layout.extents.iter().enumerate();
    let places = extents.filter(|(_, extent)| wanted(extent));
    let places = places.map(|(number, extent)| Place {
        number,
        at: extent.at,
        start_ns: extent.start_ns,
        end_ns: extent.end_ns,
    });
    let places = places.collect();
    let unpacker = Unpacker::new().map_err(ArchiveError::io(&layout.path))?;
    let chunks = McapChunks {
        layout,
        file,
        topic_by_channel,
        unpacker,
        packed: Vec::new(),
    };
    Ok(ChunkCursor::new(chunks, order, places))
}

impl Chunks for McapChunks {
    fn path(&self) -> &Path {
        &self.layout.path
    }

    fn load(
        &mut self,
        number: usize,
        loaded: &mut Loaded,
    ) -> Result<Option<DamageKind>, ArchiveError> {
        let layout = Arc::clone(&self.layout);
        let extent = &layout.extents[number];
        if let Err(reason) = self.read(extent, &mut loaded.records)? {
            let time = |ns| i64::try_from(ns).ok();
            return Ok(Some(DamageKind::Chunk {
                reason,
                start_ns: time(extent.start_ns),
                end_ns: time(extent.end_ns),
            }));
        }
        let flaw = self.list(extent, loaded);
        Ok(flaw.map(|reason| DamageKind::Record { reason }))
    }
}

impl McapChunks {
    /// Reads the records of `extent`. The inner error is the reason why they cannot be read.
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
            return Ok(Err(too_long(extent.len)));
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

    /// Lists the selected messages of an extent. Returns a description of the last malformed record, if any.
    fn list(&mut self, extent: &Extent, loaded: &mut Loaded) -> Option<String> {
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
        flaw
    }
}
