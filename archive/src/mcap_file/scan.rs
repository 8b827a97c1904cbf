//! Layout of a file without a sound index, from a scan of the whole file that also checks the decompressed chunks.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;

use mcap::records::op;

use super::chunk::{ChunkHeader, MessageHeader, Unpacker, inner_records};
use super::layout::{Extent, ExtentKind, Layout};
use super::walk::{Record, Step, Walk};
use super::{MAX_RECORD_BYTES, MESSAGE_HEADER_BYTES, RECORD_PREFIX_BYTES};
use crate::chunks::{MAX_LOADED_BYTES, too_long};
use crate::damage::DamageKind;

/// Approximate length of a run of messages outside chunks that is read at once \[bytes\].
/// Resolution: memory against the number of reads.
const PLAIN_RUN_BYTES: u64 = 1 << 20;

/// Fills `layout` by reading `file` up to the end of its data, a truncation or a malformed record.
pub(super) fn read(file: &File, layout: &mut Layout) -> io::Result<()> {
    let start = mcap::MAGIC.len() as u64;
    let mut walk = Walk::new(file.try_clone()?, start, layout.file_bytes)?;
    let mut scan = Scan {
        layout,
        unpacker: Unpacker::new()?,
        plain: PlainRun::default(),
        body: Vec::new(),
        records: Vec::new(),
    };
    let end = scan.run(&mut walk)?;
    scan.plain.close(scan.layout);
    if let Some((at, kind)) = end {
        layout.damage(at, kind);
    }
    Ok(())
}

struct Scan<'a> {
    layout: &'a mut Layout,
    unpacker: Unpacker,
    plain: PlainRun,
    body: Vec<u8>,
    records: Vec<u8>,
}

impl Scan<'_> {
    /// Reads all records. Returns the position and kind of the damage that stopped it, if any.
    fn run(&mut self, walk: &mut Walk) -> io::Result<Option<(u64, DamageKind)>> {
        let mut first = true;
        loop {
            let record = match walk.step()? {
                Step::Record(record) => record,
                Step::Torn(record) => {
                    self.plain.close(self.layout);
                    if record.opcode == op::CHUNK {
                        self.torn_chunk(walk, record)?;
                    }
                    return Ok(Some((record.at, DamageKind::TornTail)));
                }
                Step::TornPrefix(at) => return Ok(Some((at, DamageKind::TornTail))),
                Step::End => return Ok(Some((self.layout.file_bytes, DamageKind::TornTail))),
            };
            if std::mem::take(&mut first) && record.opcode != op::HEADER {
                let reason = format!("opcode {:#04x} where the header should be", record.opcode);
                return Ok(Some((record.at, DamageKind::Record { reason })));
            }
            match record.opcode {
                // Only the summary follows, whose content the scan has already found in the data.
                op::DATA_END | op::FOOTER => return Ok(None),
                op::CHUNK => {
                    // A run is a contiguous range of bytes, which must not contain a chunk.
                    self.plain.close(self.layout);
                    self.chunk(walk, record)?;
                }
                // The format forbids opcode 0. Other unknown opcodes are skipped, as it requires.
                0 => {
                    let reason = "opcode 0".to_owned();
                    return Ok(Some((record.at, DamageKind::Record { reason })));
                }
                _ => {
                    let noted =
                        note_plain(walk, record, self.layout, &mut self.plain, &mut self.body)?;
                    match noted {
                        Ok(Some(message)) => self.layout.count(&message),
                        Ok(None) => {}
                        Err(reason) => self.layout.damage(record.at, DamageKind::Record { reason }),
                    }
                }
            }
        }
    }

    fn chunk(&mut self, walk: &mut Walk, record: Record) -> io::Result<()> {
        if record.len > MAX_LOADED_BYTES as u64 {
            // The buffer still has the body of the record before, whose times are not those of this chunk.
            self.body.clear();
            self.broken_chunk(record, too_long(record.len));
            return Ok(());
        }
        walk.read(record.len as usize, &mut self.body)?;
        match self.unpacker.unpack(&self.body, &mut self.records) {
            Ok(()) => self.note_chunk(record.at, record.len, ExtentKind::Chunk),
            Err(reason) => self.broken_chunk(record, reason),
        }
        Ok(())
    }

    fn broken_chunk(&mut self, record: Record, reason: String) {
        let header = ChunkHeader::parse(&self.body).map(|(header, _)| header);
        let time = |ns: Option<u64>| ns.and_then(|ns| i64::try_from(ns).ok());
        let kind = DamageKind::Chunk {
            reason,
            start_ns: time(header.as_ref().map(|header| header.start_ns)),
            end_ns: time(header.as_ref().map(|header| header.end_ns)),
        };
        self.layout.damage(record.at, kind);
    }

    fn torn_chunk(&mut self, walk: &mut Walk, record: Record) -> io::Result<()> {
        let left = self.layout.file_bytes - record.at - RECORD_PREFIX_BYTES;
        if left > MAX_LOADED_BYTES as u64 {
            return Ok(());
        }
        walk.read_rest(&mut self.body)?;
        Unpacker::unpack_torn(&self.body, &mut self.records);
        self.note_chunk(record.at, left, ExtentKind::TornChunk);
        Ok(())
    }

    /// Records the messages and declarations in the decompressed chunk.
    fn note_chunk(&mut self, at: u64, body_len: u64, kind: ExtentKind) {
        let mut times: Option<(u64, u64)> = None;
        let mut channels = BTreeSet::new();
        for record in inner_records(&self.records) {
            let Ok(record) = record else {
                if kind == ExtentKind::Chunk {
                    let reason = "a record in the chunk is cut short".to_owned();
                    self.layout.damage(at, DamageKind::Record { reason });
                }
                break;
            };
            if let Some(message) = record.message() {
                self.layout.count(&message);
                let (start, end) = times.unwrap_or((message.log_time, message.log_time));
                times = Some((start.min(message.log_time), end.max(message.log_time)));
                channels.insert(message.channel);
            } else if let Err(reason) = self.layout.take_in(record.opcode, record.body) {
                self.layout.damage(at, DamageKind::Record { reason });
            }
        }
        if let Some((start_ns, end_ns)) = times {
            self.layout.extents.push(Extent {
                at,
                len: RECORD_PREFIX_BYTES + body_len,
                start_ns,
                end_ns,
                channels: channels.into_iter().collect(),
                kind,
            });
        }
    }
}

/// A run of consecutive messages outside chunks.
#[derive(Default)]
pub(super) struct PlainRun {
    extent: Option<Extent>,
}

impl PlainRun {
    fn add(&mut self, record: Record, message: &MessageHeader, layout: &mut Layout) {
        let end = record.at + RECORD_PREFIX_BYTES + record.len;
        let full = |extent: &Extent| end - extent.at > PLAIN_RUN_BYTES;
        if self.extent.as_ref().is_some_and(full) {
            self.close(layout);
        }
        let extent = self.extent.get_or_insert_with(|| Extent {
            at: record.at,
            len: 0,
            start_ns: message.log_time,
            end_ns: message.log_time,
            channels: Box::default(),
            kind: ExtentKind::Plain,
        });
        extent.len = end - extent.at;
        extent.start_ns = extent.start_ns.min(message.log_time);
        extent.end_ns = extent.end_ns.max(message.log_time);
    }

    /// Ends the run, if one is open.
    pub(super) fn close(&mut self, layout: &mut Layout) {
        layout.extents.extend(self.extent.take());
    }
}

/// Records a message, attachment or declaration outside chunks. Returns its header if it is a message.
///
/// The inner error is the reason why the record is invalid.
pub(super) fn note_plain(
    walk: &mut Walk,
    record: Record,
    layout: &mut Layout,
    plain: &mut PlainRun,
    body: &mut Vec<u8>,
) -> io::Result<Result<Option<MessageHeader>, String>> {
    match record.opcode {
        op::MESSAGE => {
            if record.len < MESSAGE_HEADER_BYTES as u64 {
                return Ok(Err(format!("message of {} bytes", record.len)));
            }
            walk.read(MESSAGE_HEADER_BYTES, body)?;
            let message = MessageHeader::parse(body);
            if let Some(message) = &message {
                plain.add(record, message, layout);
            }
            Ok(Ok(message))
        }
        op::ATTACHMENT => {
            plain.close(layout);
            let body_at = record.at + RECORD_PREFIX_BYTES;
            layout.attachments.push((body_at, record.len));
            Ok(Ok(None))
        }
        op::HEADER | op::SCHEMA | op::CHANNEL | op::METADATA => {
            if record.len > MAX_RECORD_BYTES {
                return Ok(Err(format!(
                    "{} bytes, the limit is {MAX_RECORD_BYTES}",
                    record.len
                )));
            }
            walk.read(record.len as usize, body)?;
            Ok(layout.take_in(record.opcode, body).map(|()| None))
        }
        _ => Ok(Ok(None)),
    }
}
