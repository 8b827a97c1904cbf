//! What every format gives: messages one after the other.

use crate::error::ArchiveError;

/// A format's way through its messages.
pub(crate) trait Cursor: Send {
    /// Goes to the next message; `false` at the end.
    ///
    /// # Errors
    /// If a part cannot be read; asked again, it goes on behind that if it can.
    fn advance(&mut self) -> Result<bool, ArchiveError>;

    /// The message it stands on, if any.
    fn current(&self) -> Option<RawMessage<'_>>;

    /// Chunks that have been read so far; 0 where the format has none.
    fn chunks_read(&self) -> u64 {
        0
    }
}

/// A message as a [`Cursor`] gives it.
pub(crate) struct RawMessage<'a> {
    /// Its topic's place in the list of topics.
    pub(crate) topic: usize,
    pub(crate) log_time_ns: i64,
    pub(crate) publish_time_ns: i64,
    pub(crate) sequence: u32,
    /// Where it lies in the file.
    pub(crate) at: u64,
    pub(crate) body: &'a [u8],
}
