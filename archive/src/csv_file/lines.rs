//! A reader that refuses lines without end, so that no file can fill the memory.

use std::io::{self, BufRead, BufReader, Read};

/// Longest line: more than 50 000 numbers \[bytes\].
/// Resolution: bounds memory.
pub(super) const MAX_LINE_BYTES: usize = 1 << 20;

pub(super) struct Lines<R> {
    reader: BufReader<R>,
    /// Bytes since the last line end.
    line_bytes: usize,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader: BufReader::new(reader),
            line_bytes: 0,
        }
    }

    /// Skips a line; gives how many bytes that were.
    pub(super) fn skip_line(&mut self) -> io::Result<u64> {
        let mut skipped = 0;
        loop {
            let buffer = self.reader.fill_buf()?;
            let end = buffer.iter().position(|&byte| byte == b'\n');
            let take = end.map_or(buffer.len(), |end| end + 1);
            self.reader.consume(take);
            skipped += take as u64;
            if end.is_some() || take == 0 {
                return Ok(skipped);
            }
        }
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.reader.read(into)?;
        for line in into[..read].split_inclusive(|&byte| byte == b'\n') {
            self.line_bytes += line.len();
            if self.line_bytes > MAX_LINE_BYTES {
                return Err(io::ErrorKind::InvalidData.into());
            }
            if line.ends_with(b"\n") {
                self.line_bytes = 0;
            }
        }
        Ok(read)
    }
}
