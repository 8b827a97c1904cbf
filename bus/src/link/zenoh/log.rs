//! Retransmission window of a sender: unacknowledged samples, and the position and credit of each receiver.
//!
//! Go-back-N, as in data links (Tanenbaum, Computer Networks, section 3.4): a receiver accepts samples in order only
//! and acknowledges its position. Its credit bounds the samples in flight. The sender retransmits from the first
//! missing sample. This module does no I/O and reads no clock.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use crate::link::{Audience, Keep};

/// Retransmission timeout; doubled after each retransmission up to [`AGAIN_AT_MOST`].
/// Resolution: the delay after a loss, against duplicates on a slow network.
const AGAIN_AFTER: Duration = Duration::from_millis(500);
/// Upper bound on the retransmission timeout.
const AGAIN_AT_MOST: Duration = Duration::from_secs(4);
/// Longest time a pausable sender waits for a disconnected receiver.
/// Chosen: longer than a switch takes to restart; a longer wait stops the source for a receiver that may not return.
const RETURN_WITHIN: Duration = Duration::from_mins(1);

/// An unacknowledged sample, and the number of samples lost right before it.
#[derive(Debug, Clone, Copy)]
struct Entry<T> {
    sequence: u64,
    gap: u64,
    sample: T,
}

/// The samples of the next message.
#[derive(Debug, Default)]
pub(super) struct Batch<T> {
    /// Sequence number of the oldest sample still available.
    pub since: u64,
    /// Number of samples lost right before the first one.
    pub gap: u64,
    /// Consecutive samples, without a gap.
    pub samples: Vec<T>,
}

/// The sender's view of one receiver.
#[derive(Debug)]
struct Reader {
    /// Connected.
    there: bool,
    /// Sequence number of the first unacknowledged sample.
    next: u64,
    /// Credit \[samples\].
    room: u64,
    /// Time of the last connection, disconnection or progress.
    moved: Instant,
    /// Start of the current retransmission timeout.
    again: Instant,
    /// Current retransmission timeout.
    wait: Duration,
    /// Stalled for longer than the stall timeout; no longer exerts back-pressure.
    given_up: bool,
    /// Samples that the receiver has reported as lost.
    lost: u64,
}

/// A sender's retransmission window.
#[derive(Debug)]
pub(super) struct Log<T> {
    keep: Keep,
    /// Number of expected receivers.
    expected: usize,
    /// Stall timeout.
    patience: Duration,
    /// Capacity \[samples\].
    most: usize,
    entries: VecDeque<Entry<T>>,
    /// Sequence number of the next new sample.
    next: u64,
    /// Samples lost since the last one.
    skipped: u64,
    /// Sequence number of the next sample to send.
    cursor: u64,
    /// Sequence number of the end mark.
    end: Option<u64>,
    /// Time at which the end mark was appended.
    ended: Option<Instant>,
    readers: BTreeMap<String, Reader>,
    /// Samples never delivered to receivers that disconnected or never connected.
    undelivered: u64,
}

impl<T: Copy> Log<T> {
    pub(super) fn new(keep: Keep, audience: Audience, most: usize, patience: Duration) -> Self {
        Self {
            keep,
            expected: audience.count(keep),
            patience,
            most: most.max(1),
            entries: VecDeque::new(),
            next: 0,
            skipped: 0,
            cursor: 0,
            end: None,
            ended: None,
            readers: BTreeMap::new(),
            undelivered: 0,
        }
    }

    /// Sequence number of the next new sample.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// Number of samples not sent yet.
    pub(super) fn waiting(&self) -> usize {
        usize::try_from(self.next.saturating_sub(self.cursor)).unwrap_or(usize::MAX)
    }

    /// Number of expected receivers that are not connected.
    pub(super) fn missing(&self) -> usize {
        let there = self.readers.values().filter(|reader| reader.there).count();
        self.expected.saturating_sub(there)
    }

    /// Samples that keep-all receivers did not get, including those that they have reported as lost.
    pub(super) fn undelivered(&self) -> u64 {
        let lost = self.readers.values().map(|reader| reader.lost);
        self.undelivered + lost.sum::<u64>()
    }

    /// Whether a pausable sender must wait for room.
    pub(super) fn is_full(&self, now: Instant) -> bool {
        let Some(oldest) = self.entries.front() else {
            return false;
        };
        let awaited = |reader: &Reader| {
            let patience = if reader.there {
                self.patience
            } else {
                RETURN_WITHIN
            };
            let waits = now.duration_since(reader.moved) < patience;
            reader.next <= oldest.sequence && !reader.given_up && waits
        };
        let waited_for = self.keep == Keep::All && self.readers.values().any(awaited);
        self.entries.len() >= self.most && waited_for
    }

    /// Advances the sequence by `count` samples lost before they could be sent.
    pub(super) fn skip(&mut self, count: u64) {
        self.next += count;
        self.skipped += count;
    }

    /// Appends a sample, and discards the oldest if the window is full.
    pub(super) fn push(&mut self, sample: T) {
        self.append(sample);
        if self.keep == Keep::All {
            let unknown = self.expected.saturating_sub(self.readers.len());
            self.undelivered += unknown as u64;
        }
    }

    /// Appends the end mark.
    pub(super) fn push_end(&mut self, mark: T, now: Instant) {
        self.end = Some(self.next);
        self.ended = Some(now);
        self.append(mark);
    }

    fn append(&mut self, sample: T) {
        if self.entries.len() >= self.most {
            self.evict();
        }
        self.entries.push_back(Entry {
            sequence: self.next,
            gap: std::mem::take(&mut self.skipped),
            sample,
        });
        self.next += 1;
    }

    fn evict(&mut self) {
        let Some(oldest) = self.entries.pop_front() else {
            return;
        };
        let gap = match self.entries.front_mut() {
            Some(next) => &mut next.gap,
            None => &mut self.skipped,
        };
        *gap += oldest.gap + 1;
    }

    /// Adds a receiver that has connected or reconnected, with a credit of `room` samples. A receiver that replaces a
    /// lost one resumes at its position.
    pub(super) fn join(&mut self, id: &str, room: u64, now: Instant) {
        if let Some(reader) = self.readers.get_mut(id) {
            reader.there = true;
            reader.moved = now;
            reader.given_up = false;
            self.cursor = self.cursor.min(reader.next);
            return;
        }
        let mut next = self.next;
        if self.readers.len() >= self.expected.max(1) {
            let absent = self.readers.iter().filter(|(_, reader)| !reader.there);
            let longest = absent.min_by_key(|(_, reader)| reader.moved);
            if let Some(former) = longest.map(|(id, _)| id.clone())
                && let Some(former) = self.readers.remove(&former)
            {
                next = former.next;
                self.undelivered += former.lost;
                self.cursor = self.cursor.min(next);
            }
        }
        let reader = Reader {
            there: true,
            next,
            room: room.max(1),
            moved: now,
            again: now,
            wait: AGAIN_AFTER,
            given_up: false,
            lost: 0,
        };
        self.readers.insert(id.to_owned(), reader);
    }

    /// Marks a receiver as disconnected, by a network failure or a crash. Removes one beyond the expected number.
    pub(super) fn lose(&mut self, id: &str, now: Instant) {
        if self.readers.len() > self.expected {
            self.leave(id);
            return;
        }
        if let Some(reader) = self.readers.get_mut(id) {
            reader.there = false;
            reader.moved = now;
        }
    }

    /// Removes a receiver that has disconnected normally.
    pub(super) fn leave(&mut self, id: &str) {
        let gone = self.readers.remove(id);
        self.undelivered += gone.map_or(0, |reader| reader.lost);
        self.trim();
    }

    /// Processes the acknowledgement of all samples before `next`, of which `lost` were lost. With `misses`, the
    /// receiver requests a retransmission.
    pub(super) fn taken(&mut self, id: &str, (next, lost): (u64, u64), misses: bool, now: Instant) {
        let Some(reader) = self.readers.get_mut(id) else {
            return;
        };
        if self.keep == Keep::All {
            reader.lost = lost.min(self.next);
        }
        // An acknowledgement cannot go beyond the newest sample.
        let next = next.min(self.next);
        if next > reader.next {
            reader.wait = AGAIN_AFTER;
        }
        if next > reader.next || reader.given_up {
            reader.moved = now;
            reader.again = now;
        }
        reader.given_up = false;
        // The position may go back: the receiver may have restarted.
        reader.next = next;
        if misses {
            reader.again = now;
            self.cursor = self.cursor.min(next);
        }
        self.trim();
    }

    /// Drops the samples that all receivers have acknowledged.
    fn trim(&mut self) {
        let taken = match self.keep {
            Keep::All => self.readers.values().map(|reader| reader.next).min(),
            Keep::Newest => None,
        };
        let until = taken.unwrap_or(self.cursor);
        while let Some(oldest) = self.entries.front()
            && oldest.sequence < until
            && (Some(oldest.sequence) != self.end || self.untaken() == 0)
        {
            self.entries.pop_front();
        }
    }

    /// Number of receivers that have not acknowledged the end, including disconnected ones, which may reconnect.
    pub(super) fn untaken(&self) -> usize {
        let Some(end) = self.end else { return 0 };
        let readers = self.readers.values();
        readers.filter(|reader| reader.next <= end).count()
    }

    /// Whether a receiver that has not acknowledged the end has made progress within `timeout`, counted from the end
    /// mark at the earliest.
    pub(super) fn is_awaited(&self, now: Instant, timeout: Duration) -> bool {
        let (Some(end), Some(ended)) = (self.end, self.ended) else {
            return false;
        };
        let mut readers = self.readers.values();
        readers.any(|reader| {
            reader.next <= end && now.duration_since(reader.moved.max(ended)) < timeout
        })
    }

    /// Drops all samples when the sender shuts down, and counts the unacknowledged ones as undelivered.
    pub(super) fn abandon(&mut self) {
        if self.keep == Keep::All {
            let all = self.end.unwrap_or(self.next);
            let left = |reader: &Reader| all.saturating_sub(reader.next);
            self.undelivered += self.readers.values().map(left).sum::<u64>();
        }
        self.entries.clear();
    }

    /// Whether the window is empty.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Returns the next samples to send, at most `most`; `None` without samples or without credit.
    pub(super) fn batch(&mut self, most: usize, now: Instant) -> Option<Batch<T>> {
        let limit = self.limit(now);
        let since = self.entries.front()?.sequence;
        self.cursor = self.cursor.max(since);
        let from = self
            .entries
            .partition_point(|entry| entry.sequence < self.cursor);
        let mut batch = Batch {
            since,
            gap: self.entries.get(from)?.gap,
            samples: Vec::new(),
        };
        for entry in self.entries.range(from..) {
            let holds = entry.sequence < limit && batch.samples.len() < most;
            if !holds || (entry.gap > 0 && !batch.samples.is_empty()) {
                break;
            }
            batch.samples.push(entry.sample);
            self.cursor = entry.sequence + 1;
        }
        if self.keep == Keep::Newest || self.readers.is_empty() {
            self.trim();
        }
        (!batch.samples.is_empty()).then_some(batch)
    }

    /// Sequence number of the first sample beyond the credit of the receivers.
    fn limit(&mut self, now: Instant) -> u64 {
        if self.keep == Keep::Newest || self.readers.is_empty() {
            return u64::MAX;
        }
        let (cursor, patience) = (self.cursor, self.patience);
        let mut limit = None;
        for reader in self.readers.values_mut().filter(|reader| reader.there) {
            let end = reader.next.saturating_add(reader.room);
            if end <= cursor && now.duration_since(reader.moved) >= patience {
                reader.given_up = true;
            }
            if !reader.given_up {
                limit = Some(limit.map_or(end, |limit: u64| limit.min(end)));
            }
        }
        // Without an active receiver, the samples stay in the window.
        limit.unwrap_or(0)
    }

    /// Moves the cursor back to the first sample whose retransmission timeout has expired.
    pub(super) fn look_back(&mut self, now: Instant) {
        let mut from = self.cursor;
        for reader in self.readers.values_mut() {
            let waits = reader.there && !reader.given_up && reader.next < self.cursor;
            let ends = self
                .end
                .is_some_and(|end| reader.next <= end && end < self.cursor);
            if !waits || (self.keep == Keep::Newest && !ends) {
                reader.again = reader.again.max(reader.moved);
                continue;
            }
            if now.duration_since(reader.again.max(reader.moved)) >= reader.wait {
                from = from.min(reader.next);
                reader.again = now;
                reader.wait = (reader.wait * 2).min(AGAIN_AT_MOST);
            }
        }
        self.cursor = from;
    }
}

#[cfg(test)]
mod tests;
