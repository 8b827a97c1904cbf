//! The messages of several recordings as if they were one.

use std::ops::RangeInclusive;
use std::sync::Arc;

use super::Recording;
use crate::cursor::{Cursor, RawMessage};
use crate::error::ArchiveError;

/// One of several recordings.
pub(super) struct Part {
    pub(super) recording: Recording,
    /// What the whole calls each of its topics.
    pub(super) topics: Vec<usize>,
}

/// Opens a part when its time has come and closes it when it is done: a bag may have thousands.
pub(super) struct SeveralCursor {
    parts: Arc<Vec<Part>>,
    wanted: Vec<bool>,
    within_ns: RangeInclusive<i64>,
    /// Parts not opened yet; the last one begins first.
    waiting: Vec<usize>,
    open: Vec<Open>,
    /// Index into `open`: whose message was given last.
    current: Option<usize>,
    /// Chunks read in the parts that are done.
    chunks_before: u64,
}

struct Open {
    part: usize,
    cursor: Box<dyn Cursor>,
    /// Whether it stands on a message that is to be given.
    ready: bool,
}

impl SeveralCursor {
    /// Over the topics marked in `wanted`, by their place in the whole. What lies outside `within_ns` may be left out.
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

    /// Brings every open part onto its next message; closes those that have none.
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

    /// The open part whose message comes first, and the message's log time.
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
