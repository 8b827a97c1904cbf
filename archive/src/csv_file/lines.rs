//! Reader that normalises the line ends of a table and limits the length of its records.

use std::io::{self, BufRead as _, BufReader, Read};

/// Maximum length of a record \[bytes\].
/// Resolution: bounds memory; holds more than 50 000 numbers.
pub(super) const MAX_LINE_BYTES: usize = 1 << 20;
/// Size of a read \[bytes\]. The delimiter is determined from the first one.
/// Chosen: holds the header and the first row of any known recorder.
pub(super) const BUFFER_BYTES: usize = 1 << 16;

/// Converts every line end (`\r\n`, `\r`, `\n`) to `\n`, and rejects a record that exceeds the limit.
pub(super) struct Lines<R> {
    reader: BufReader<R>,
    after_return: bool,
    at_end: bool,
    /// Bytes since [`Lines::start_record`]; `None` before the first call.
    record_bytes: Option<usize>,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(reader: R) -> Self {
        Self {
            reader: BufReader::new(reader),
            after_return: false,
            at_end: false,
            record_bytes: None,
        }
    }

    /// Starts to count the bytes of a record. Bytes that the consumer has already buffered are not counted.
    pub(super) fn start_record(&mut self) {
        self.record_bytes = Some(0);
    }

    /// Returns whether a read has reached the end of the file.
    pub(super) fn at_end(&self) -> bool {
        self.at_end
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut written = 0;
        // A chunk that is only the second half of `\r\n` writes nothing, which is not yet the end.
        while written == 0 && !into.is_empty() {
            let chunk = self.reader.fill_buf()?;
            if chunk.is_empty() {
                self.at_end = true;
                return Ok(0);
            }
            let taken = chunk.len().min(into.len());
            for &byte in &chunk[..taken] {
                let is_second_half = byte == b'\n' && self.after_return;
                self.after_return = byte == b'\r';
                if !is_second_half {
                    into[written] = if self.after_return { b'\n' } else { byte };
                    written += 1;
                }
            }
            self.reader.consume(taken);
        }
        if let Some(bytes) = &mut self.record_bytes {
            *bytes += written;
            // The consumer reads ahead: one buffer of the counted bytes may belong to later records.
            if *bytes > MAX_LINE_BYTES + BUFFER_BYTES {
                return Err(io::ErrorKind::InvalidData.into());
            }
        }
        Ok(written)
    }
}
