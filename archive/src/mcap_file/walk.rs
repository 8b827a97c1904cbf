//! From record to record through a part of a file, reading only what is asked for.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use super::RECORD_PREFIX_BYTES;

/// Where a record lies.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record {
    pub(super) opcode: u8,
    /// Its opcode's place in the file.
    pub(super) at: u64,
    /// Length of its body.
    pub(super) len: u64,
}

/// What comes next.
pub(super) enum Step {
    /// A whole record.
    Record(Record),
    /// A record that says it is longer than what is left.
    Torn(Record),
    /// Fewer bytes than a record begins with, at this place.
    TornPrefix(u64),
    /// The end of the part.
    End,
}

pub(super) struct Walk {
    reader: BufReader<File>,
    /// Where the reader stands.
    position: u64,
    /// Where the next record begins.
    next: u64,
    end: u64,
}

impl Walk {
    /// Over bytes `from..end` of `file`; `from` must be where a record begins.
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

    /// The next record; what was not read of the one before is skipped.
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

    /// The next `len` bytes of the body of the record that [`Walk::step`] gave.
    pub(super) fn read(&mut self, len: usize, into: &mut Vec<u8>) -> io::Result<()> {
        into.clear();
        let read = (&mut self.reader).take(len as u64).read_to_end(into)?;
        self.position += read as u64;
        if read < len {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(())
    }

    /// What is left from here to the end of the part.
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
