//! Sequential access to the messages of a chunked file.
//!
//! A chunk is loaded when the cursor reaches its start time and dropped after its last message. Only the chunks that
//! overlap the current log time are in memory.

use crate::cursor::{Cursor, RawMessage};
use crate::damage::{Damage, DamageKind};
use crate::error::ArchiveError;
use std::ops::RangeInclusive;
use std::path::Path;

/// Maximum size of a chunk, compressed or not, and of all decompressed chunks in memory \[bytes\].
/// Resolution: bounds memory.
pub(crate) const MAX_LOADED_BYTES: usize = 1 << 30;

/// Order in which messages are returned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Order {
    /// By log time; messages of equal log time in file order.
    LogTime,
    /// In file order.
    File,
}

/// Position of a chunk in its file, and its time range.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Index of the chunk, as passed to [`Chunks::load`].
    pub(crate) number: usize,
    pub(crate) at: u64,
    /// Log time of its first message.
    pub(crate) start_ns: u64,
    /// Log time of its last message.
    pub(crate) end_ns: u64,
}

/// A chunk in memory.
#[derive(Default)]
pub(crate) struct Loaded {
    at: u64,
    /// Buffer with the message bodies, to which [`Entry::body_at`] refers.
    pub(crate) records: Vec<u8>,
    /// The selected messages, in file order until they are sorted by log time.
    pub(crate) messages: Vec<Entry>,
    /// Number of messages already returned.
    given: usize,
}

/// A message in a loaded chunk. Its times are at most `i64::MAX`.
#[derive(Clone, Copy)]
pub(crate) struct Entry {
    pub(crate) log_time: u64,
    pub(crate) publish_time: u64,
    pub(crate) sequence: u32,
    pub(crate) topic: u32,
    pub(crate) body_at: usize,
    pub(crate) body_len: usize,
}

/// A file format that stores messages in chunks.
pub(crate) trait Chunks: Send {
    /// The file.
    fn path(&self) -> &Path;

    /// Loads the chunk `number` into `loaded`, which the caller has cleared. Returns the damage if a part of the
    /// chunk cannot be read. If none of it can be read, `loaded` has no messages.
    ///
    /// # Errors
    /// If nothing more can be read from the file.
    fn load(
        &mut self,
        number: usize,
        loaded: &mut Loaded,
    ) -> Result<Option<DamageKind>, ArchiveError>;
}

/// A [`Cursor`] over the chunks of a file.
pub(crate) struct ChunkCursor<C> {
    chunks: C,
    order: Order,
    /// Chunks in the order in which they are loaded.
    places: Vec<Place>,
    next_place: usize,
    loaded: Vec<Loaded>,
    /// Index into `loaded` of the chunk with the current message.
    current: Option<usize>,
    /// Log time of the last message returned.
    given_until_ns: Option<u64>,
    /// Damage to report before the next message.
    damage: Option<Damage>,
    /// Buffers of a finished chunk, for reuse.
    spare: Option<Loaded>,
}

impl<C: Chunks> ChunkCursor<C> {
    /// Creates a cursor over the chunks at `places`.
    pub(crate) fn new(chunks: C, order: Order, mut places: Vec<Place>) -> Self {
        // `advance` loads a chunk as soon as its start time is reached, so the next one must have the earliest start.
        places.sort_by_key(|place| match order {
            Order::LogTime => (place.start_ns, place.at),
            Order::File => (0, place.at),
        });
        Self {
            chunks,
            order,
            places,
            next_place: 0,
            loaded: Vec::new(),
            current: None,
            given_until_ns: None,
            damage: None,
            spare: None,
        }
    }

    /// Drops the chunks outside this range of log times \[ns since the epoch\]. Chunks at its edges also hold
    /// messages outside it.
    pub(crate) fn within(mut self, within_ns: &RangeInclusive<i64>) -> Self {
        let of = |ns: i64| u64::try_from(ns).unwrap_or(0);
        let (from_ns, to_ns) = (of(*within_ns.start()), of(*within_ns.end()));
        self.places
            .retain(|place| place.start_ns <= to_ns && place.end_ns >= from_ns);
        self
    }

    /// Returns the loaded chunk whose next message comes first, and the log time of that message.
    fn first(&self) -> Option<(usize, u64)> {
        let head = |loaded: &Loaded| loaded.messages[loaded.given];
        (0..self.loaded.len())
            .min_by_key(|&i| {
                let loaded = &self.loaded[i];
                (head(loaded).log_time, loaded.at)
            })
            .map(|i| (i, head(&self.loaded[i]).log_time))
    }

    fn load(&mut self, place: Place) -> Result<(), ArchiveError> {
        let mut loaded = self.spare.take().unwrap_or_default();
        loaded.at = place.at;
        loaded.records.clear();
        loaded.messages.clear();
        loaded.given = 0;
        let damage = self.chunks.load(place.number, &mut loaded)?;
        self.damage = damage.map(|kind| Damage {
            path: self.chunks.path().to_owned(),
            at: place.at,
            kind,
            readable_until_ns: self.given_until_ns.and_then(|ns| i64::try_from(ns).ok()),
        });
        if loaded.messages.is_empty() {
            self.spare = Some(loaded);
            return Ok(());
        }
        let in_order = loaded.messages.is_sorted_by_key(|m| m.log_time);
        if self.order == Order::LogTime && !in_order {
            loaded.messages.sort_by_key(|message| message.log_time);
        }
        self.loaded.push(loaded);
        let bytes: usize = self.loaded.iter().map(|loaded| loaded.records.len()).sum();
        if self.loaded.len() > 1 && bytes > MAX_LOADED_BYTES {
            return Err(ArchiveError::TooMuchOverlap {
                path: self.chunks.path().to_owned(),
                log_time_ns: i64::try_from(place.start_ns).unwrap_or(i64::MAX),
                loaded: bytes,
                limit: MAX_LOADED_BYTES,
            });
        }
        Ok(())
    }
}

impl<C: Chunks> Cursor for ChunkCursor<C> {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        if let Some(i) = self.current.take() {
            let loaded = &mut self.loaded[i];
            loaded.given += 1;
            if loaded.given == loaded.messages.len() {
                self.spare = Some(self.loaded.swap_remove(i));
            }
        }
        loop {
            if let Some(damage) = self.damage.take() {
                return Err(ArchiveError::Damaged(damage));
            }
            let first = self.first();
            let next = self.places.get(self.next_place).copied();
            let load = match (first, next) {
                (_, None) => None,
                (None, next) => next,
                (Some(_), Some(_)) if self.order == Order::File => None,
                (Some((_, log_time)), Some(next)) => (next.start_ns <= log_time).then_some(next),
            };
            let Some(place) = load else {
                self.current = first.map(|(i, _)| i);
                self.given_until_ns = first.map(|(_, log_time)| log_time).or(self.given_until_ns);
                return Ok(self.current.is_some());
            };
            self.next_place += 1;
            self.load(place)?;
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
            at: loaded.at,
            body: &loaded.records[message.body_at..message.body_at + message.body_len],
        })
    }

    fn chunks_read(&self) -> u64 {
        self.next_place as u64
    }
}

/// Describes a length over the limit.
pub(crate) fn too_long(bytes: u64) -> String {
    format!("{bytes} bytes, the limit is {MAX_LOADED_BYTES}")
}
