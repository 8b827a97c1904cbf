//! Reading MCAP files (<https://mcap.dev/spec>) chunk by chunk.
//!
//! [`Layout::read`] determines the contents of the file from the index at its end, or from a scan of the whole file
//! if the index is missing or damaged. [`mcap_cursor`] then loads chunks as they are needed and returns their
//! messages in the order of log time. Only the index and the chunks that overlap the current log time are in memory.

mod attachment;
mod chunk;
mod cursor;
mod index;
mod layout;
mod read;
mod scan;
mod walk;

pub(crate) use attachment::attachment_header;
pub(crate) use cursor::mcap_cursor;
pub(crate) use index::{CRC_FROM_END_BYTES, read_footer, summary_crc};
pub(crate) use layout::Layout;

/// Maximum length of a record other than a chunk or an attachment \[bytes\].
/// Resolution: bounds memory.
const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Opcode and length before each record \[bytes\].
/// Physical: the MCAP format: an opcode of 1 byte and a length of 8.
const RECORD_PREFIX_BYTES: u64 = 9;
/// Channel, sequence, log and publish time before a message's body \[bytes\].
/// Physical: the MCAP format: 2 + 4 + 8 + 8 bytes.
const MESSAGE_HEADER_BYTES: usize = 22;
