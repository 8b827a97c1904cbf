//! Counters of a stage that survive its crash.
//!
//! A report is up to a tenth of a second old when a stage is killed. Each stage therefore also keeps its counters in
//! a memory-mapped file that its supervisor has created. The kernel keeps the written values when the writer is
//! killed. A sample is counted before it is sent, so that a link never delivers more samples than were counted.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::MmapRaw;

use crate::link::{Position, ReceiverCounts};
use crate::sample::Header;
use crate::seat::Seat;

/// Number of words of the stage itself: emitted, stamp of the newest sample.
const OWN: usize = 2;
/// Number of words per input: received, lost, refused, before, foreign, whether a position follows, instance, next,
/// broken off.
const EACH: usize = 9;
/// Index of the last of these words.
const BROKEN_OFF: usize = 8;

/// Counters of a stage in a memory-mapped file; without a file by default. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Ledger(Option<Arc<MmapRaw>>);

impl Ledger {
    /// Length of the file for a stage with this number of inputs \[bytes\].
    pub fn length(inputs: usize) -> usize {
        (OWN + EACH * inputs) * size_of::<u64>()
    }

    /// Opens the file that the seat names. On a failure the stage works without it.
    pub fn of(seat: &Seat) -> Self {
        let Some(path) = &seat.ledger else {
            return Self::default();
        };
        Self::open(path).unwrap_or_else(|error| {
            let stage = &seat.stage;
            tracing::warn!(stage, %error, "the counters of this stage are lost if it crashes");
            Self::default()
        })
    }

    /// Maps a file of the length that [`Ledger::length`] returns.
    ///
    /// # Errors
    /// If the file cannot be opened or mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file: File = OpenOptions::new().read(true).write(true).open(path)?;
        Ok(Self(Some(Arc::new(MmapRaw::map_raw(&file)?))))
    }

    /// Records the number of emitted samples, including the one with the header `newest`, which is about to be sent.
    pub(super) fn emitted(&self, count: u64, newest: &Header) {
        self.put(1, newest.stamp_ns.cast_unsigned());
        self.put(0, count);
    }

    /// Records the counters and the position of an input.
    pub(super) fn heard(&self, input: usize, counts: &ReceiverCounts, position: Option<Position>) {
        let at = OWN + EACH * input;
        let ReceiverCounts {
            received,
            lost,
            refused,
            before,
            foreign,
            broken_off,
        } = *counts;
        let numbers = [received, lost, refused, before, foreign];
        for (place, number) in (at..).zip(numbers) {
            self.put(place, number);
        }
        self.put(at + BROKEN_OFF, broken_off);
        if let Some(Position { instance, next }) = position {
            self.put(at + 6, instance);
            self.put(at + 7, next);
            self.put(at + 5, 1);
        }
    }

    /// Records the number of samples received from an input, including the one with this header, which is about to be
    /// processed.
    pub(super) fn takes(&self, input: usize, received: u64, header: &Header) {
        let at = OWN + EACH * input;
        self.put(at, received);
        self.put(at + 7, header.sequence.saturating_add(1));
    }

    #[allow(unsafe_code)]
    #[expect(
        clippy::cast_ptr_alignment,
        reason = "a mapping begins at a page, and a place is a multiple of eight bytes from there"
    )]
    fn put(&self, place: usize, number: u64) {
        let Some(map) = &self.0 else { return };
        if (place + 1) * size_of::<u64>() > map.len() {
            return;
        }
        // SAFETY: the place is within the mapping, which lives as long as `map`. A mapping begins at a page, so that
        // the word is aligned. This process accesses the memory through atomics only; others map or read it
        // separately.
        let word = unsafe { AtomicU64::from_ptr(map.as_mut_ptr().cast::<u64>().add(place)) };
        word.store(number, Ordering::Release);
    }
}

/// Contents of a [`Ledger`] after the crash of its stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Account {
    /// Samples emitted.
    pub emitted: u64,
    /// Stamp of the newest emitted sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Counters and position of each input.
    pub inputs: Vec<(ReceiverCounts, Option<Position>)>,
}

impl Account {
    /// Decodes the bytes of a ledger.
    pub fn read(bytes: &[u8]) -> Self {
        let (words, _) = bytes.as_chunks::<8>();
        let words: Vec<u64> = words.iter().map(|word| u64::from_ne_bytes(*word)).collect();
        let (own, inputs) = words.split_at(OWN.min(words.len()));
        let inputs = inputs.as_chunks::<EACH>().0.iter();
        let inputs = inputs.map(|words| {
            let [
                received,
                lost,
                refused,
                before,
                foreign,
                heard,
                instance,
                next,
                broken_off,
            ] = *words;
            let counts = ReceiverCounts {
                received,
                lost,
                refused,
                before,
                foreign,
                broken_off,
            };
            (counts, (heard != 0).then_some(Position { instance, next }))
        });
        Self {
            emitted: own.first().copied().unwrap_or(0),
            stamp_ns: own.get(1).copied().unwrap_or(0).cast_signed(),
            inputs: inputs.collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_noted_is_in_the_file_at_once() {
        let path = std::env::temp_dir().join(format!("ledger_{}", std::process::id()));
        let length = Ledger::length(2);
        std::fs::write(&path, vec![0; length]).unwrap();
        let ledger = Ledger::open(&path).unwrap();
        let header = Header {
            stamp_ns: -5,
            sequence: 41,
            ..Header::default()
        };
        let counts = ReceiverCounts {
            received: 7,
            lost: 2,
            broken_off: 1,
            ..ReceiverCounts::default()
        };
        let position = Position {
            instance: 3,
            next: 9,
        };
        ledger.emitted(42, &header);
        ledger.heard(1, &counts, Some(position));
        ledger.takes(1, 8, &header);
        // A write beyond the end of the file is ignored.
        ledger.heard(2, &counts, Some(position));
        let account = Account::read(&std::fs::read(&path).unwrap());
        std::fs::remove_file(&path).unwrap();
        assert_eq!((account.emitted, account.stamp_ns), (42, -5));
        let second = ReceiverCounts {
            received: 8,
            ..counts
        };
        let there = Position {
            instance: 3,
            next: 42,
        };
        let none = (ReceiverCounts::default(), None);
        assert_eq!(account.inputs, [none, (second, Some(there))]);
    }

    #[test]
    fn a_stage_without_a_supervisor_notes_nothing() {
        Ledger::default().emitted(1, &Header::default());
        assert!(Account::read(&[]).inputs.is_empty());
    }
}
