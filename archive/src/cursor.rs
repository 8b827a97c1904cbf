//! Sequential access to messages, implemented by every format.

use crate::error::ArchiveError;

/// A forward cursor over the messages of a recording.
pub(crate) trait Cursor: Send {
    /// Advances to the next message; returns `false` at the end.
    ///
    /// # Errors
    /// If a part of the recording cannot be read. The next call continues behind that part if possible.
    fn advance(&mut self) -> Result<bool, ArchiveError>;

    /// Returns the current message, if any.
    fn current(&self) -> Option<RawMessage<'_>>;

    /// Returns the number of chunks read so far; 0 for a format without chunks.
    fn chunks_read(&self) -> u64 {
        0
    }
}

/// A message as a [`Cursor`] returns it.
pub(crate) struct RawMessage<'a> {
    /// Index of its topic in the list of topics.
    pub(crate) topic: usize,
    pub(crate) log_time_ns: i64,
    pub(crate) publish_time_ns: i64,
    pub(crate) sequence: u32,
    /// Position in the file: byte offset, row or line.
    pub(crate) at: u64,
    pub(crate) body: &'a [u8],
}
