//! A chunk: its header, its decompressed content, and the records in it.

use std::io::Read;

use mcap::records::op;

use super::{MESSAGE_HEADER_BYTES, RECORD_PREFIX_BYTES};
use crate::chunks::MAX_LOADED_BYTES;
use crate::fields::Fields;

/// Header of a chunk.
pub(super) struct ChunkHeader<'a> {
    pub(super) start_ns: u64,
    pub(super) end_ns: u64,
    unpacked_bytes: u64,
    crc: u32,
    compression: &'a str,
    packed_bytes: u64,
}

impl<'a> ChunkHeader<'a> {
    /// Parses the header at the start of a chunk record's body. Returns it with the compressed records after it. The
    /// body may be truncated.
    pub(super) fn parse(body: &'a [u8]) -> Option<(Self, &'a [u8])> {
        let mut fields = Fields(body);
        let header = Self {
            start_ns: fields.u64()?,
            end_ns: fields.u64()?,
            unpacked_bytes: fields.u64()?,
            crc: fields.u32()?,
            compression: fields.text()?,
            packed_bytes: fields.u64()?,
        };
        Some((header, fields.0))
    }
}

/// Decompressor of chunks, with state that is reused from one chunk to the next.
pub(super) struct Unpacker {
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Unpacker {
    pub(super) fn new() -> std::io::Result<Self> {
        Ok(Self {
            zstd: zstd::bulk::Decompressor::new()?,
        })
    }

    /// Decompresses the records of the chunk whose record body is `body`, and checks their length and CRC.
    ///
    /// # Errors
    /// The reason why they cannot be used; the content of `records` is then undefined.
    pub(super) fn unpack(&mut self, body: &[u8], records: &mut Vec<u8>) -> Result<(), String> {
        records.clear();
        let (header, packed) = ChunkHeader::parse(body).ok_or("its header is broken")?;
        let packed = usize::try_from(header.packed_bytes)
            .ok()
            .and_then(|len| packed.get(..len))
            .ok_or_else(|| {
                format!(
                    "its header declares {} bytes of records, {} are present",
                    header.packed_bytes,
                    packed.len()
                )
            })?;
        let unpacked_bytes = usize::try_from(header.unpacked_bytes)
            .ok()
            .filter(|&bytes| bytes <= MAX_LOADED_BYTES)
            .ok_or_else(|| {
                format!(
                    "it unpacks to {} bytes, the limit is {MAX_LOADED_BYTES}",
                    header.unpacked_bytes
                )
            })?;
        match header.compression {
            "" => records.extend_from_slice(packed),
            "zstd" => {
                // Reserves address space; memory is allocated only when it is written to.
                records.reserve(unpacked_bytes);
                self.zstd
                    .decompress_to_buffer(packed, records)
                    .map_err(|error| format!("zstd: {error}"))?;
            }
            "lz4" => {
                lz4::Decoder::new(packed)
                    .and_then(|decoder| {
                        decoder.take(unpacked_bytes as u64 + 1).read_to_end(records)
                    })
                    .map_err(|error| format!("lz4: {error}"))?;
            }
            other => return Err(format!("compression {other:?} is not known")),
        }
        if records.len() != unpacked_bytes {
            return Err(format!(
                "it unpacks to {} bytes, its header says {unpacked_bytes}",
                records.len()
            ));
        }
        let crc = crc32fast::hash(records);
        if header.crc != 0 && header.crc != crc {
            return Err(format!(
                "its CRC is {crc:08x}, its header says {:08x}",
                header.crc
            ));
        }
        Ok(())
    }

    /// Decompresses the readable part of a chunk that is truncated within `body`. It is not checked, because the
    /// checksum covers the whole chunk.
    pub(super) fn unpack_torn(body: &[u8], records: &mut Vec<u8>) {
        records.clear();
        let Some((header, packed)) = ChunkHeader::parse(body) else {
            return;
        };
        let limit = MAX_LOADED_BYTES as u64;
        // Both decoders write all available data before they report the truncation.
        let _missing_rest = match header.compression {
            "" => packed.take(limit).read_to_end(records),
            "zstd" => zstd::stream::read::Decoder::with_buffer(packed)
                .and_then(|decoder| decoder.take(limit).read_to_end(records)),
            "lz4" => lz4::Decoder::new(packed)
                .and_then(|decoder| decoder.take(limit).read_to_end(records)),
            _ => Ok(0),
        };
    }
}

/// A record in a decompressed chunk.
pub(super) struct Inner<'a> {
    pub(super) opcode: u8,
    /// Offset of its body in the decompressed chunk.
    pub(super) at: usize,
    pub(super) body: &'a [u8],
}

/// Iterates over the records in `records`. The last item is an `Err` with the offset of a truncated record, if any.
pub(super) fn inner_records(records: &[u8]) -> impl Iterator<Item = Result<Inner<'_>, usize>> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let rest = records.get(at..).filter(|rest| !rest.is_empty())?;
        let mut fields = Fields(rest);
        let inner = fields
            .take(1)
            .and_then(|opcode| Some((opcode[0], usize::try_from(fields.u64()?).ok()?)))
            .and_then(|(opcode, len)| {
                Some(Inner {
                    opcode,
                    at: at + RECORD_PREFIX_BYTES as usize,
                    body: fields.take(len)?,
                })
            });
        match inner {
            Some(inner) => {
                at = inner.at + inner.body.len();
                Some(Ok(inner))
            }
            None => Some(Err(std::mem::replace(&mut at, usize::MAX))),
        }
    })
}

/// Header of a message record.
#[derive(Debug, Clone, Copy)]
pub(super) struct MessageHeader {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
}

impl MessageHeader {
    /// Parses the header at the front of a message record's body; the message follows after [`MESSAGE_HEADER_BYTES`].
    pub(super) fn parse(body: &[u8]) -> Option<Self> {
        let mut fields = Fields(body.get(..MESSAGE_HEADER_BYTES)?);
        Some(Self {
            channel: fields.u16()?,
            sequence: fields.u32()?,
            log_time: fields.u64()?,
            publish_time: fields.u64()?,
        })
    }
}

impl Inner<'_> {
    /// Returns the message header, if this is a message.
    pub(super) fn message(&self) -> Option<MessageHeader> {
        (self.opcode == op::MESSAGE)
            .then(|| MessageHeader::parse(self.body))
            .flatten()
    }
}
