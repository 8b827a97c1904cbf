//! Sequential access to the messages of a bag.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use super::Ros1Bag;
use super::chunk::Unpacker;
use super::record::{Inner, Records, inner_records, op};
use crate::chunks::{ChunkCursor, Chunks, Entry, Loaded, Order, Place};
use crate::damage::DamageKind;
use crate::error::ArchiveError;

/// Loader of the chunks of a bag.
pub(crate) struct Ros1Chunks {
    bag: Arc<Ros1Bag>,
    records: Records,
    unpacker: Unpacker,
    unpacked: Vec<u8>,
    lister: Lister,
}

/// Creates a cursor over the connections for which `topic` returns a number.
pub(crate) fn ros1_cursor(
    bag: Arc<Ros1Bag>,
    topic: impl Fn(u32) -> Option<usize>,
) -> Result<ChunkCursor<Ros1Chunks>, ArchiveError> {
    let file = File::open(&bag.path).map_err(ArchiveError::io(&bag.path))?;
    let connections = bag
        .connections
        .keys()
        .map(|&number| (number, topic(number).map(|topic| topic as u32)));
    let lister = Lister {
        connections: connections.collect(),
    };
    let wanted = |number: &u32| {
        // An undeclared connection is damage, which loading the chunk reports.
        lister.connections.get(number).is_none_or(Option::is_some)
    };
    let chunks = bag.chunks.iter().enumerate();
    let places = chunks.filter(|(_, chunk)| chunk.connections.iter().any(wanted));
    let places = places.map(|(number, chunk)| Place {
        number,
        at: chunk.at,
        start_ns: chunk.start_ns,
        end_ns: chunk.end_ns,
    });
    let places = places.collect();
    let chunks = Ros1Chunks {
        records: Records::new(file, bag.file_bytes),
        bag,
        unpacker: Unpacker::default(),
        unpacked: Vec::new(),
        lister,
    };
    Ok(ChunkCursor::new(chunks, Order::LogTime, places))
}

impl Chunks for Ros1Chunks {
    fn path(&self) -> &Path {
        &self.bag.path
    }

    fn load(
        &mut self,
        number: usize,
        loaded: &mut Loaded,
    ) -> Result<Option<DamageKind>, ArchiveError> {
        let chunk = &self.bag.chunks[number];
        let read = self
            .unpacker
            .read(&mut self.records, chunk.at, chunk.torn, &mut self.unpacked)
            .map_err(ArchiveError::io(&self.bag.path))?;
        if let Err(reason) = read {
            return Ok(Some(DamageKind::Chunk {
                reason,
                start_ns: Some(chunk.start_ns as i64),
                end_ns: Some(chunk.end_ns as i64),
            }));
        }
        let mut flaw = None;
        for record in inner_records(&self.unpacked) {
            let listed = match record {
                Some(record) => self.lister.list(&record, loaded),
                None if chunk.torn => Ok(()),
                None => Err("a record in the chunk is cut short".to_owned()),
            };
            if let Err(reason) = listed {
                flaw = Some(DamageKind::Record { reason });
            }
        }
        Ok(flaw)
    }
}

/// Adds the selected messages of a chunk to its list.
struct Lister {
    /// Topic number of each connection; `None` if it is not selected.
    connections: BTreeMap<u32, Option<u32>>,
}

impl Lister {
    /// Lists a record if it is a selected message. The error is the reason why the record is invalid.
    fn list(&self, record: &Inner<'_>, loaded: &mut Loaded) -> Result<(), String> {
        if record.header.op() != Some(op::MESSAGE) {
            return Ok(());
        }
        let number = record.header.u32("conn");
        let number = number.ok_or("a message without a connection")?;
        let time_ns = record.header.time_ns("time");
        let time_ns = time_ns.ok_or("a message without a time")?;
        let topic = self.connections.get(&number);
        let topic = topic.ok_or_else(|| format!("message on undeclared connection {number}"))?;
        let Some(topic) = *topic else {
            return Ok(());
        };
        let body_at = loaded.records.len();
        loaded.records.extend_from_slice(record.data);
        loaded.messages.push(Entry {
            log_time: time_ns,
            publish_time: time_ns,
            sequence: 0,
            topic,
            body_at,
            body_len: loaded.records.len() - body_at,
        });
        Ok(())
    }
}
