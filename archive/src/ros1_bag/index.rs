//! The index at the end of a bag: its connections, and the contents of each chunk.

use std::collections::BTreeMap;
use std::io;

use super::record::{Header, Records, Step, op};
use super::{Chunk, MAX_RECORD_BYTES, Ros1Bag};
use crate::fields::Fields;

/// The only version of these records.
/// Physical: the format of bags 2.0.
const CHUNK_INFO_VERSION: u32 = 1;
/// Longest index that is read \[bytes\].
/// Resolution: bounds memory.
const MAX_INDEX_BYTES: u64 = 256 << 20;

/// Fills `bag` from its index, which should have the numbers of connections and chunks in `counts`.
///
/// # Errors
/// The inner error is the reason why the index cannot be used; `bag` is then partly filled.
pub(super) fn read(
    bag: &mut Ros1Bag,
    records: &mut Records,
    index_at: u64,
    counts: (Option<u32>, Option<u32>),
) -> io::Result<Result<(), String>> {
    if index_at > bag.file_bytes {
        return Ok(Err(format!(
            "it should begin at {index_at}, behind the end of the file"
        )));
    }
    if bag.file_bytes - index_at > MAX_INDEX_BYTES {
        return Ok(Err(format!(
            "it is longer than {MAX_INDEX_BYTES} bytes, which is the limit"
        )));
    }
    records.go_to(index_at)?;
    let mut data = Vec::new();
    loop {
        let head = match records.step()? {
            Step::Record(head) => head,
            Step::End => break,
            Step::Torn { at, .. } => return Ok(Err(format!("it is torn off at {at}"))),
            Step::Nonsense { at, reason } => return Ok(Err(format!("at {at}: {reason}"))),
        };
        if head.data_len > MAX_RECORD_BYTES {
            return Ok(Err(format!("a record of {} bytes", head.data_len)));
        }
        records.data(&head, &mut data)?;
        let header = Header(&head.header);
        let noted = match header.op() {
            Some(op::CONNECTION) => bag.connect(header, &data),
            Some(op::CHUNK_INFO) => note_chunk(bag, header, &data, index_at),
            _ => Err("a record that does not belong there".to_owned()),
        };
        if let Err(reason) = noted {
            return Ok(Err(format!("at {}: {reason}", head.at)));
        }
    }
    let found = (bag.connections.len() as u64, bag.chunks.len() as u64);
    let (connections, chunks) = counts;
    if (connections.map(u64::from), chunks.map(u64::from)) != (Some(found.0), Some(found.1)) {
        return Ok(Err(format!(
            "it has {} connections and {} chunks, the header of the bag says otherwise",
            found.0, found.1
        )));
    }
    Ok(Ok(()))
}

fn note_chunk(
    bag: &mut Ros1Bag,
    header: Header<'_>,
    data: &[u8],
    index_at: u64,
) -> Result<(), String> {
    if header.u32("ver") != Some(CHUNK_INFO_VERSION) {
        return Err("of a version that is not known".to_owned());
    }
    let (Some(at), Some(start_ns), Some(end_ns)) = (
        header.u64("chunk_pos").filter(|&at| at < index_at),
        header.time_ns("start_time"),
        header.time_ns("end_time"),
    ) else {
        return Err("it does not say where a chunk lies, or when".to_owned());
    };
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    let mut fields = Fields(data);
    while !fields.0.is_empty() {
        let (Some(connection), Some(count)) = (fields.u32(), fields.u32()) else {
            return Err("what a chunk holds is cut short".to_owned());
        };
        *counts.entry(connection).or_default() += u64::from(count);
    }
    let chunk = Chunk {
        at,
        start_ns,
        end_ns,
        connections: counts.keys().copied().collect(),
        torn: false,
    };
    bag.add(chunk, &counts)
}
