//! Layout of a file, read from the index at its end and the records between its chunks.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{ChunkIndex, Footer, Record, Statistics, op};

use super::layout::{Extent, ExtentKind, Layout, parse};
use super::scan::{PlainRun, note_plain};
use super::walk::{Step, Walk};
use super::{MAX_RECORD_BYTES, RECORD_PREFIX_BYTES};

/// Size of the body of the footer record \[bytes\].
/// Physical: the MCAP format: two offsets of 8 bytes and a CRC of 4.
const FOOTER_BODY_BYTES: u64 = 20;
/// Size of the footer record and the magic after it \[bytes\].
/// Physical: the MCAP format.
const FILE_END_BYTES: u64 = RECORD_PREFIX_BYTES + FOOTER_BODY_BYTES + mcap::MAGIC.len() as u64;

/// Distance of the summary's CRC from the end of the file \[bytes\].
/// Physical: the MCAP format: the CRC is the last field of the footer.
pub(crate) const CRC_FROM_END_BYTES: u64 = 4 + mcap::MAGIC.len() as u64;

pub(super) enum Outcome {
    /// The layout is complete.
    Complete,
    /// The file has no index, or an incomplete one.
    Absent,
    /// The index is damaged.
    Unsound { at: u64, reason: String },
}

/// Fills `layout` from the index of `file`. Unless the outcome is complete, the content of `layout` is undefined.
pub(super) fn read(file: &File, layout: &mut Layout) -> io::Result<Outcome> {
    let Some(footer) = read_footer(file, layout.file_bytes)? else {
        return Ok(Outcome::Unsound {
            at: layout.file_bytes,
            reason: "the file does not end in a footer".to_owned(),
        });
    };
    let start = footer.summary_start;
    if start == 0 {
        return Ok(Outcome::Absent);
    }
    let end = layout.file_bytes - FILE_END_BYTES;
    let unsound = |at, reason: String| Ok(Outcome::Unsound { at, reason });
    if start > end || start < mcap::MAGIC.len() as u64 {
        return unsound(end, format!("its start, byte {start}, is out of range"));
    }
    if let Some(reason) = check_crc(file, &footer, layout.file_bytes)? {
        return unsound(start, reason);
    }
    let mut summary = Summary::default();
    if let Err((at, reason)) = summary.read(file, layout, start, end)? {
        return unsound(at, reason);
    }
    let Some(statistics) = summary.statistics else {
        return Ok(Outcome::Absent);
    };
    // A summary may omit channel records whose messages its statistics count. A scan finds them in the data.
    let known = |id| layout.channels.contains_key(id);
    if !statistics.channel_message_counts.keys().all(known) {
        return Ok(Outcome::Absent);
    }
    layout.counts = statistics.channel_message_counts;
    if statistics.message_count > 0 {
        layout.widen(statistics.message_start_time, statistics.message_end_time);
    }
    summary.chunks.sort_by_key(|chunk| chunk.chunk_start_offset);
    match place(file, layout, &summary.chunks, start)? {
        Ok(()) => Ok(Outcome::Complete),
        Err((at, reason)) => unsound(at, reason),
    }
}

/// Reads the footer, if the file ends in one.
pub(crate) fn read_footer(mut file: &File, file_bytes: u64) -> io::Result<Option<Footer>> {
    if file_bytes < FILE_END_BYTES + mcap::MAGIC.len() as u64 {
        return Ok(None);
    }
    let mut end = [0; FILE_END_BYTES as usize];
    file.seek(SeekFrom::Start(file_bytes - FILE_END_BYTES))?;
    file.read_exact(&mut end)?;
    let Some(record) = end.strip_suffix(mcap::MAGIC) else {
        return Ok(None);
    };
    let (prefix, body) = record.split_at(RECORD_PREFIX_BYTES as usize);
    if prefix[0] != op::FOOTER || prefix[1..] != FOOTER_BODY_BYTES.to_le_bytes() {
        return Ok(None);
    }
    Ok(match mcap::parse_record(op::FOOTER, body) {
        Ok(Record::Footer(footer)) => Some(footer),
        _ => None,
    })
}

fn check_crc(file: &File, footer: &Footer, file_bytes: u64) -> io::Result<Option<String>> {
    if footer.summary_crc == 0 {
        return Ok(None);
    }
    let crc = summary_crc(file, footer.summary_start, file_bytes)?;
    let saved = footer.summary_crc;
    Ok((crc != saved).then(|| format!("its CRC is {crc:08x}, the footer says {saved:08x}")))
}

/// Computes the CRC of the summary: from its beginning to just before the CRC itself in the footer.
pub(crate) fn summary_crc(mut file: &File, summary_start: u64, file_bytes: u64) -> io::Result<u32> {
    file.seek(SeekFrom::Start(summary_start))?;
    let mut left = file.take((file_bytes - CRC_FROM_END_BYTES).saturating_sub(summary_start));
    let mut hasher = crc32fast::Hasher::new();
    let mut buffer = [0; 16 << 10];
    loop {
        let read = left.read(&mut buffer)?;
        if read == 0 {
            return Ok(hasher.finalize());
        }
        hasher.update(&buffer[..read]);
    }
}

/// File offset and description of a flaw.
type Flaw = (u64, String);

#[derive(Default)]
struct Summary {
    chunks: Vec<ChunkIndex>,
    statistics: Option<Statistics>,
}

impl Summary {
    fn read(
        &mut self,
        file: &File,
        layout: &mut Layout,
        start: u64,
        end: u64,
    ) -> io::Result<Result<(), Flaw>> {
        let mut walk = Walk::new(file.try_clone()?, start, end)?;
        let mut body = Vec::new();
        loop {
            let record = match walk.step()? {
                Step::Record(record) if record.len <= MAX_RECORD_BYTES => record,
                Step::End => return Ok(Ok(())),
                Step::Record(record) | Step::Torn(record) => {
                    return Ok(Err((record.at, format!("record of {} bytes", record.len))));
                }
                Step::TornPrefix(at) => return Ok(Err((at, "half a record".to_owned()))),
            };
            walk.read(record.len as usize, &mut body)?;
            let taken = match record.opcode {
                op::CHUNK_INDEX | op::STATISTICS => {
                    parse(record.opcode, &body).map(|parsed| match parsed {
                        Record::ChunkIndex(chunk) => self.chunks.push(chunk),
                        Record::Statistics(statistics) => self.statistics = Some(statistics),
                        _ => {}
                    })
                }
                opcode => layout.take_in(opcode, &body),
            };
            if let Err(reason) = taken {
                return Ok(Err((record.at, reason)));
            }
        }
    }
}

/// Checks that the chunks and the records between them make up the whole data section, and records both.
fn place(
    file: &File,
    layout: &mut Layout,
    chunks: &[ChunkIndex],
    data_end: u64,
) -> io::Result<Result<(), Flaw>> {
    let mut at = mcap::MAGIC.len() as u64;
    for chunk in chunks {
        if chunk.chunk_start_offset < at {
            let reason = "chunks that overlap in the file".to_owned();
            return Ok(Err((chunk.chunk_start_offset, reason)));
        }
        if let Err(flaw) = between(file, layout, at, chunk.chunk_start_offset)? {
            return Ok(Err(flaw));
        }
        let next = chunk
            .chunk_start_offset
            .checked_add(chunk.chunk_length)
            .and_then(|end| end.checked_add(chunk.message_index_length))
            .filter(|&end| end <= data_end);
        let Some(next) = next else {
            let reason = "a chunk that reaches beyond the data".to_owned();
            return Ok(Err((chunk.chunk_start_offset, reason)));
        };
        layout.extents.push(Extent {
            at: chunk.chunk_start_offset,
            len: chunk.chunk_length,
            start_ns: chunk.message_start_time,
            end_ns: chunk.message_end_time,
            channels: chunk.message_index_offsets.keys().copied().collect(),
            kind: ExtentKind::Chunk,
        });
        at = next;
    }
    between(file, layout, at, data_end)
}

/// Reads the records between chunks: the header, metadata, attachments, and messages outside chunks.
fn between(file: &File, layout: &mut Layout, from: u64, end: u64) -> io::Result<Result<(), Flaw>> {
    if from == end {
        return Ok(Ok(()));
    }
    let mut walk = Walk::new(file.try_clone()?, from, end)?;
    let mut plain = PlainRun::default();
    let mut body = Vec::new();
    loop {
        let record = match walk.step()? {
            Step::Record(record) if record.opcode == op::CHUNK => {
                return Ok(Err((record.at, "a chunk that it does not list".to_owned())));
            }
            Step::Record(record) if record.opcode != op::DATA_END => record,
            Step::End | Step::Record(_) => break,
            Step::Torn(record) => {
                return Ok(Err((record.at, format!("record of {} bytes", record.len))));
            }
            Step::TornPrefix(at) => return Ok(Err((at, "half a record".to_owned()))),
        };
        // The statistics have counted the messages already.
        if let Err(reason) = note_plain(&mut walk, record, layout, &mut plain, &mut body)? {
            return Ok(Err((record.at, reason)));
        }
    }
    plain.close(layout);
    Ok(Ok(()))
}
