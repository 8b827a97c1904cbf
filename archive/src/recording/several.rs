//! Merging of the messages of several recordings.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::Recording;
use crate::cursor::{Cursor, RawMessage};
use crate::error::ArchiveError;

/// One of several recordings.
pub(super) struct Part {
    pub(super) recording: Recording,
    /// Index of each of its topics in the merged list.
    pub(super) topics: Vec<usize>,
}

/// Cursor over the merged messages. It opens a part at its start time and closes it at its end, because a bag may
/// have thousands of parts.
pub(super) struct SeveralCursor {
    parts: Arc<Vec<Part>>,
    wanted: Vec<bool>,
    within_ns: RangeInclusive<i64>,
    /// Parts not opened yet, in descending order of start time.
    waiting: Vec<usize>,
    open: Vec<Open>,
    /// Index into `open` of the part with the current message.
    current: Option<usize>,
    /// Number of chunks read in the closed parts.
    chunks_before: u64,
}

struct Open {
    part: usize,
    cursor: Box<dyn Cursor>,
    /// Whether the cursor is at a message that has not been returned yet.
    ready: bool,
}

impl SeveralCursor {
    /// Creates a cursor over the topics marked in `wanted`, by their index in the merged list. Messages outside
    /// `within_ns` may be omitted.
    pub(super) fn new(
        parts: Arc<Vec<Part>>,
        wanted: &[bool],
        within_ns: RangeInclusive<i64>,
    ) -> Self {
        let start_ns = |&part: &usize| parts[part].recording.start_ns();
        let mut waiting: Vec<_> = (0..parts.len())
            .filter(|part| start_ns(part).is_some())
            .collect();
        waiting.sort_by_key(|part| std::cmp::Reverse((start_ns(part), *part)));
        Self {
            parts,
            wanted: wanted.to_vec(),
            within_ns,
            waiting,
            open: Vec::new(),
            current: None,
            chunks_before: 0,
        }
    }

    /// Advances every open part to its next message, and closes those that have none.
    fn get_ready(&mut self) -> Result<(), ArchiveError> {
        let mut i = 0;
        while let Some(open) = self.open.get_mut(i) {
            if open.ready || open.cursor.advance()? {
                open.ready = true;
                i += 1;
            } else {
                let done = self.open.swap_remove(i);
                self.chunks_before += done.cursor.chunks_read();
            }
        }
        Ok(())
    }

    /// Returns the open part whose message comes first, and the log time of that message.
    fn first(&self) -> Option<(usize, i64)> {
        let key = |i: &usize| {
            let open = &self.open[*i];
            let log_time_ns = open.cursor.current()?.log_time_ns;
            Some((log_time_ns, open.part))
        };
        let first = (0..self.open.len()).min_by_key(key)?;
        Some((first, key(&first)?.0))
    }

    fn open_part(&mut self, part: usize) -> Result<(), ArchiveError> {
        let Part { recording, topics } = &self.parts[part];
        let wanted: Vec<_> = topics.iter().map(|&topic| self.wanted[topic]).collect();
        self.open.push(Open {
            part,
            cursor: recording.cursor(&wanted, &self.within_ns)?,
            ready: false,
        });
        Ok(())
    }
}

impl Cursor for SeveralCursor {
    fn advance(&mut self) -> Result<bool, ArchiveError> {
        if let Some(i) = self.current.take() {
            self.open[i].ready = false;
        }
        loop {
            self.get_ready()?;
            let first = self.first();
            let starts = |&&part: &&usize| {
                let start_ns = self.parts[part].recording.start_ns();
                first.is_none_or(|(_, log_time_ns)| start_ns <= Some(log_time_ns))
            };
            let Some(&part) = self.waiting.last().filter(starts) else {
                self.current = first.map(|(i, _)| i);
                return Ok(self.current.is_some());
            };
            self.waiting.pop();
            self.open_part(part)?;
        }
    }

    fn current(&self) -> Option<RawMessage<'_>> {
        let open = &self.open[self.current?];
        let message = open.cursor.current()?;
        Some(RawMessage {
            topic: self.parts[open.part].topics[message.topic],
            ..message
        })
    }

    fn chunks_read(&self) -> u64 {
        let open = self.open.iter().map(|open| open.cursor.chunks_read());
        self.chunks_before + open.sum::<u64>()
    }
}
