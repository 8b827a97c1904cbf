//! What a sender keeps until its receivers have taken it: who has come how far, what goes out next, what goes out
//! again.
//!
//! Go-back-N, as in data links (Tanenbaum, Computer Networks, section 3.4): a receiver takes samples in their order
//! only and says how far it has come and how much room it has; what does not arrive goes out again from there. No I/O
//! and no clock in here.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use crate::link::{Audience, Keep};

/// A receiver that says nothing for so long, though something is on its way, is sent it again.
/// Resolution: the delay after a loss, against samples that are sent twice over a slow network.
const AGAIN_AFTER: Duration = Duration::from_millis(500);
/// The wait doubles up to this.
const AGAIN_AT_MOST: Duration = Duration::from_secs(4);
/// So long a sender whose source can wait does so for a receiver that the network has cut off.
/// Tuned: by hand, on no recorded seeds; not swept. Longer than a switch takes to restart.
const RETURN_WITHIN: Duration = Duration::from_mins(1);

/// A sample that waits, and how many were lost right before it.
#[derive(Debug, Clone, Copy)]
struct Entry<T> {
    sequence: u64,
    gap: u64,
    sample: T,
}

/// What goes out next.
#[derive(Debug, Default)]
pub(super) struct Batch<T> {
    /// The oldest sample that can still be had.
    pub since: u64,
    /// How many were lost right before the first one.
    pub gap: u64,
    /// One after the other, without a hole.
    pub samples: Vec<T>,
}

/// One receiver, as far as is known.
#[derive(Debug)]
struct Reader {
    /// The network reaches it.
    there: bool,
    /// It has taken all before this one.
    next: u64,
    /// How many it has room for.
    room: u64,
    /// When it came, went or took something last.
    moved: Instant,
    /// When something was sent to it again, and how long is waited before that is done once more.
    again: Instant,
    wait: Duration,
    /// It has taken nothing for the sender's patience: it holds up nobody any more.
    given_up: bool,
    /// Samples that it has found lost.
    lost: u64,
}

/// See above.
#[derive(Debug)]
pub(super) struct Log<T> {
    keep: Keep,
    /// How many receivers are expected.
    expected: usize,
    patience: Duration,
    /// How many samples may wait.
    most: usize,
    entries: VecDeque<Entry<T>>,
    /// Number of the next sample.
    next: u64,
    /// Samples lost since the last one.
    skipped: u64,
    /// Number of the sample that goes out next.
    cursor: u64,
    /// The number of the end mark.
    end: Option<u64>,
    readers: BTreeMap<String, Reader>,
    /// What those did not get that have gone or never came.
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
            readers: BTreeMap::new(),
            undelivered: 0,
        }
    }

    /// The number of the next sample.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// How many samples have not gone out yet.
    pub(super) fn waiting(&self) -> usize {
        usize::try_from(self.next.saturating_sub(self.cursor)).unwrap_or(usize::MAX)
    }

    /// How many receivers are missing.
    pub(super) fn missing(&self) -> usize {
        let there = self.readers.values().filter(|reader| reader.there).count();
        self.expected.saturating_sub(there)
    }

    /// Samples that those who keep all did not get, as far as they have said.
    pub(super) fn undelivered(&self) -> u64 {
        let lost = self.readers.values().map(|reader| reader.lost);
        self.undelivered + lost.sum::<u64>()
    }

    /// Whether a sender that can wait waits for room.
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

    /// So many samples are lost before they could be sent.
    pub(super) fn skip(&mut self, count: u64) {
        self.next += count;
        self.skipped += count;
    }

    /// Appends a sample; if there is no room, the oldest gives way.
    pub(super) fn push(&mut self, sample: T) {
        self.append(sample);
        if self.keep == Keep::All {
            let unknown = self.expected.saturating_sub(self.readers.len());
            self.undelivered += unknown as u64;
        }
    }

    /// Appends the end mark.
    pub(super) fn push_end(&mut self, mark: T) {
        self.end = Some(self.next);
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

    /// A receiver is there, or there again, with room for `room` samples. One that has come for another that was lost
    /// goes on where that was.
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

    /// The network does not reach a receiver any more, or it is dead. One that nobody expected is forgotten.
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

    /// A receiver has left in order.
    pub(super) fn leave(&mut self, id: &str) {
        let gone = self.readers.remove(id);
        self.undelivered += gone.map_or(0, |reader| reader.lost);
        self.trim();
    }

    /// A receiver has taken all before `next` but for those it has found lost; whether it misses what was sent already.
    pub(super) fn taken(&mut self, id: &str, (next, lost): (u64, u64), misses: bool, now: Instant) {
        let Some(reader) = self.readers.get_mut(id) else {
            return;
        };
        if self.keep == Keep::All {
            reader.lost = lost.min(self.next);
        }
        // Nobody has taken what was not sent.
        let next = next.min(self.next);
        if next > reader.next {
            reader.wait = AGAIN_AFTER;
        }
        if next > reader.next || reader.given_up {
            reader.moved = now;
            reader.again = now;
        }
        reader.given_up = false;
        // It may have begun anew.
        reader.next = next;
        if misses {
            reader.again = now;
            self.cursor = self.cursor.min(next);
        }
        self.trim();
    }

    /// Forgets what all have taken.
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

    /// How many have not taken the end; one that the network has cut off may come back.
    pub(super) fn untaken(&self) -> usize {
        let Some(end) = self.end else { return 0 };
        let readers = self.readers.values();
        readers.filter(|reader| reader.next <= end).count()
    }

    /// The sender leaves: what they have not taken, they will not get.
    pub(super) fn abandon(&mut self) {
        if self.keep == Keep::All {
            let all = self.end.unwrap_or(self.next);
            let left = |reader: &Reader| all.saturating_sub(reader.next);
            self.undelivered += self.readers.values().map(left).sum::<u64>();
        }
        self.entries.clear();
    }

    /// Whether all that waits has been taken.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// What goes out next, at most `most` samples in one go; nothing while nobody has room.
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

    /// The first sample that does not go out yet.
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
        // While nobody is there it waits here.
        limit.unwrap_or(0)
    }

    /// Goes back to what a receiver should have said something about by now.
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
