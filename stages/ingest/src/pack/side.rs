//! Newest messages of a side topic, by stamp.

use std::collections::VecDeque;

/// Maximum number of messages kept; more than a topic gets ahead of the states.
/// Resolution: memory; about 0.25 s at 1 kHz.
const CAPACITY: usize = 256;

/// The newest messages of a topic, in the order of their stamps.
#[derive(Debug)]
pub(super) struct Side<T> {
    entries: VecDeque<(i64, T)>,
}

impl<T> Default for Side<T> {
    fn default() -> Self {
        Self {
            entries: VecDeque::with_capacity(CAPACITY),
        }
    }
}

impl<T> Side<T> {
    /// Adds a message. Drops messages with an equal or later stamp: their publisher has restarted since.
    pub fn push(&mut self, stamp_ns: i64, value: T) {
        while self
            .entries
            .back()
            .is_some_and(|(newest, _)| *newest >= stamp_ns)
        {
            self.entries.pop_back();
        }
        if self.entries.len() == CAPACITY {
            self.entries.pop_front();
        }
        self.entries.push_back((stamp_ns, value));
    }

    /// Whether a message of this instant or later has arrived, so that [`Side::at`] cannot change.
    pub fn reaches(&self, stamp_ns: i64) -> bool {
        self.entries
            .back()
            .is_some_and(|(newest, _)| *newest >= stamp_ns)
    }

    /// Returns the newest message at or before `stamp_ns`, unless it is older than `max_age_ns`. Drops all earlier
    /// messages.
    pub fn at(&mut self, stamp_ns: i64, max_age_ns: i64) -> Option<&T> {
        while self
            .entries
            .get(1)
            .is_some_and(|(next, _)| *next <= stamp_ns)
        {
            self.entries.pop_front();
        }
        self.entries
            .front()
            .filter(|(at, _)| *at <= stamp_ns && stamp_ns.saturating_sub(*at) <= max_age_ns)
            .map(|(_, value)| value)
    }

    /// Drops the messages after `stamp_ns`, to which the clock was set back.
    pub fn forget_after(&mut self, stamp_ns: i64) {
        self.entries.retain(|(at, _)| *at <= stamp_ns);
    }
}
