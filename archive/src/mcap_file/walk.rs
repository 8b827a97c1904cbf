//! Iteration over the records in a byte range of a file. Only the requested bodies are read.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use super::RECORD_PREFIX_BYTES;

/// Position of a record in the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record {
    pub(super) opcode: u8,
    /// File offset of its opcode.
    pub(super) at: u64,
    /// Length of its body.
    pub(super) len: u64,
}

/// Result of a step to the next record.
pub(super) enum Step {
    /// A whole record.
    Record(Record),
    /// A record whose declared length exceeds the rest of the range.
    Torn(Record),
    /// An incomplete record prefix at this offset.
    TornPrefix(u64),
    /// The end of the range.
    End,
}

pub(super) struct Walk {
    reader: BufReader<File>,
    /// File offset of the reader.
    position: u64,
    /// File offset of the next record.
    next: u64,
    end: u64,
}

impl Walk {
    /// Creates a walk over the bytes `from..end` of `file`; a record must begin at `from`.
    pub(super) fn new(file: File, from: u64, end: u64) -> io::Result<Self> {
        let mut reader = BufReader::with_capacity(64 << 10, file);
        reader.seek(SeekFrom::Start(from))?;
        Ok(Self {
            reader,
            position: from,
            next: from,
            end,
        })
    }

    /// Advances to the next record. Skips what was not read of the preceding one.
    pub(super) fn step(&mut self) -> io::Result<Step> {
        self.jump(self.next)?;
        let at = self.next;
        let left = self.end.saturating_sub(at);
        if left == 0 {
            return Ok(Step::End);
        }
        if left < RECORD_PREFIX_BYTES {
            return Ok(Step::TornPrefix(at));
        }
        let mut prefix = [0; RECORD_PREFIX_BYTES as usize];
        self.fill(&mut prefix)?;
        let [opcode, len @ ..] = prefix;
        let record = Record {
            opcode,
            at,
            len: u64::from_le_bytes(len),
        };
        if record.len > left - RECORD_PREFIX_BYTES {
            self.next = self.end;
            return Ok(Step::Torn(record));
        }
        self.next = at + RECORD_PREFIX_BYTES + record.len;
        Ok(Step::Record(record))
    }

    /// Reads the next `len` bytes of the body of the record that [`Walk::step`] returned.
    pub(super) fn read(&mut self, len: usize, into: &mut Vec<u8>) -> io::Result<()> {
        into.clear();
        let read = (&mut self.reader).take(len as u64).read_to_end(into)?;
        self.position += read as u64;
        if read < len {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(())
    }

    /// Reads the bytes from the current offset to the end of the range.
    pub(super) fn read_rest(&mut self, into: &mut Vec<u8>) -> io::Result<()> {
        let left = self.end.saturating_sub(self.position) as usize;
        self.read(left, into)
    }

    fn fill(&mut self, into: &mut [u8]) -> io::Result<()> {
        self.reader.read_exact(into)?;
        self.position += into.len() as u64;
        Ok(())
    }

    fn jump(&mut self, to: u64) -> io::Result<()> {
        self.reader
            .seek_relative(to.wrapping_sub(self.position) as i64)?;
        self.position = to;
        Ok(())
    }
}
