//! Contents of a bag without a sound index, from reading all of it and decompressing its chunks.

use std::collections::BTreeMap;
use std::io;

use super::chunk::Unpacker;
use super::record::{Header, Records, Step, inner_records, op};
use super::{Chunk, MAX_RECORD_BYTES, Ros1Bag};
use crate::damage::DamageKind;

/// Fills `bag` from all following records, up to a truncation or a malformed record. Returns whether there is one.
pub(super) fn read(bag: &mut Ros1Bag, records: &mut Records) -> io::Result<bool> {
    let mut scan = Scan {
        bag,
        unpacker: Unpacker::default(),
        unpacked: Vec::new(),
    };
    let mut data = Vec::new();
    loop {
        let head = match records.step()? {
            Step::Record(head) => head,
            Step::End => return Ok(false),
            Step::Nonsense { at, reason } => {
                scan.bag.damage(at, DamageKind::Record { reason });
                return Ok(true);
            }
            Step::Torn { at, head } => {
                let op = head.as_ref().and_then(|head| Header(&head.header).op());
                match op {
                    Some(op::CHUNK) => scan.chunk(records, at, true)?,
                    // The record follows all messages: nothing is lost.
                    Some(op::CHUNK_INFO) => return Ok(false),
                    _ => {}
                }
                scan.bag.damage(at, DamageKind::TornTail);
                return Ok(true);
            }
        };
        let next = head.data_at + head.data_len;
        let header = Header(&head.header);
        match header.op() {
            Some(op::CHUNK) => scan.chunk(records, head.at, false)?,
            Some(op::CONNECTION) if head.data_len <= MAX_RECORD_BYTES => {
                records.data(&head, &mut data)?;
                scan.note(head.at, |bag| bag.connect(header, &data));
            }
            Some(op::CONNECTION | op::INDEX_DATA | op::CHUNK_INFO | op::BAG_HEADER) => {}
            _ => {
                let reason = "a record that does not belong there".to_owned();
                scan.bag.damage(head.at, DamageKind::Record { reason });
                return Ok(true);
            }
        }
        records.go_to(next)?;
    }
}

struct Scan<'a> {
    bag: &'a mut Ros1Bag,
    unpacker: Unpacker,
    unpacked: Vec<u8>,
}

impl Scan<'_> {
    fn chunk(&mut self, records: &mut Records, at: u64, torn: bool) -> io::Result<()> {
        let read = self.unpacker.read(records, at, torn, &mut self.unpacked)?;
        if let Err(reason) = read {
            let kind = DamageKind::Chunk {
                reason,
                start_ns: None,
                end_ns: None,
            };
            self.bag.damage(at, kind);
            return Ok(());
        }
        let unpacked = std::mem::take(&mut self.unpacked);
        self.note(at, |bag| note_chunk(bag, &unpacked, at, torn));
        self.unpacked = unpacked;
        Ok(())
    }

    fn note(&mut self, at: u64, note: impl FnOnce(&mut Ros1Bag) -> Result<(), String>) {
        if let Err(reason) = note(self.bag) {
            self.bag.damage(at, DamageKind::Record { reason });
        }
    }
}

/// Records the contents of a decompressed chunk.
fn note_chunk(bag: &mut Ros1Bag, records: &[u8], at: u64, torn: bool) -> Result<(), String> {
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    let mut times: Option<(u64, u64)> = None;
    // Reading the chunk reports malformed records; here only the valid ones are counted.
    for record in inner_records(records).flatten() {
        match record.header.op() {
            Some(op::CONNECTION) => bag.connect(record.header, record.data)?,
            Some(op::MESSAGE) => {
                let number = record.header.u32("conn");
                let time_ns = record.header.time_ns("time");
                let (Some(number), Some(ns)) = (number, time_ns) else {
                    continue;
                };
                if bag.connections.contains_key(&number) {
                    *counts.entry(number).or_default() += 1;
                    let (start_ns, end_ns) = times.unwrap_or((ns, ns));
                    times = Some((start_ns.min(ns), end_ns.max(ns)));
                }
            }
            _ => {}
        }
    }
    let (start_ns, end_ns) = times.unwrap_or_default();
    let chunk = Chunk {
        at,
        start_ns,
        end_ns,
        connections: counts.keys().copied().collect(),
        torn,
    };
    bag.add(chunk, &counts)
}
