//! Records of a bag: a header of named fields, and data.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};

use crate::fields::Fields;

/// Longest header that is read \[bytes\].
/// Resolution: bounds memory; the longest field is the name of a topic.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Kinds of records, by the value of the field `op`.
pub(super) mod op {
    pub(crate) const MESSAGE: u8 = 0x02;
    pub(crate) const BAG_HEADER: u8 = 0x03;
    pub(crate) const INDEX_DATA: u8 = 0x04;
    pub(crate) const CHUNK: u8 = 0x05;
    pub(crate) const CHUNK_INFO: u8 = 0x06;
    pub(crate) const CONNECTION: u8 = 0x07;
}

/// The fields of a header.
#[derive(Clone, Copy)]
pub(super) struct Header<'a>(pub(super) &'a [u8]);

impl<'a> Header<'a> {
    /// The value of the field `name`.
    pub(super) fn get(self, name: &str) -> Option<&'a [u8]> {
        let mut fields = Fields(self.0);
        loop {
            let field = fields.bytes()?;
            if let Some([b'=', value @ ..]) = field.strip_prefix(name.as_bytes()) {
                return Some(value);
            }
        }
    }

    pub(super) fn op(self) -> Option<u8> {
        match self.get("op")? {
            [op] => Some(*op),
            _ => None,
        }
    }

    pub(super) fn u32(self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    pub(super) fn u64(self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    /// A time \[ns since the epoch\]. Always less than `i64::MAX`: it is stored as two `u32`.
    pub(super) fn time_ns(self, name: &str) -> Option<u64> {
        let mut fields = Fields(self.get(name)?);
        let (s, ns) = (fields.u32()?, fields.u32()?);
        Some(u64::from(s) * 1_000_000_000 + u64::from(ns))
    }
}

/// A record in a decompressed chunk.
pub(super) struct Inner<'a> {
    pub(super) header: Header<'a>,
    pub(super) data: &'a [u8],
}

/// Iterates over the records in `records`. The last item is `None` if its record is truncated.
pub(super) fn inner_records(records: &[u8]) -> impl Iterator<Item = Option<Inner<'_>>> {
    let mut fields = Fields(records);
    std::iter::from_fn(move || {
        if fields.0.is_empty() {
            return None;
        }
        let header = fields.bytes().map(Header);
        let inner = header.and_then(|header| {
            Some(Inner {
                header,
                data: fields.bytes()?,
            })
        });
        if inner.is_none() {
            fields.0 = &[];
        }
        Some(inner)
    })
}

/// Header of a record in the file, with the position of its data.
#[derive(Default)]
pub(super) struct Head {
    /// File offset of the record.
    pub(super) at: u64,
    pub(super) header: Vec<u8>,
    pub(super) data_at: u64,
    /// Declared length of the data; the file has all of them in a [`Step::Record`].
    pub(super) data_len: u64,
}

/// Result of a step to the next record.
pub(super) enum Step {
    Record(Head),
    /// The file ends within this record.
    Torn {
        at: u64,
        /// Its header, if that is complete.
        head: Option<Head>,
    },
    /// A malformed record.
    Nonsense {
        at: u64,
        reason: String,
    },
    End,
}

/// Cursor over the records of a file.
pub(super) struct Records {
    file: BufReader<File>,
    /// File offset of the next record.
    next: u64,
    end: u64,
}

impl Records {
    pub(super) fn new(file: File, end: u64) -> Self {
        Self {
            file: BufReader::new(file),
            next: 0,
            end,
        }
    }

    pub(super) fn go_to(&mut self, at: u64) -> io::Result<()> {
        self.next = self.file.seek(SeekFrom::Start(at))?;
        Ok(())
    }

    /// Replaces the content of `into` by the next `len` bytes, or fewer at the end of the file.
    pub(super) fn read(&mut self, len: u64, into: &mut Vec<u8>) -> io::Result<()> {
        into.clear();
        self.next += (&mut self.file).take(len).read_to_end(into)? as u64;
        Ok(())
    }

    /// Reads the header of the next record. Its data are skipped unless [`Records::data`] reads them.
    pub(super) fn step(&mut self) -> io::Result<Step> {
        self.go_to_next()?;
        let at = self.next;
        if self.file.fill_buf()?.is_empty() {
            return Ok(Step::End);
        }
        let Some(len) = self.length()? else {
            return Ok(Step::Torn { at, head: None });
        };
        if len > MAX_HEADER_BYTES {
            let reason = format!("a header of {len} bytes, the limit is {MAX_HEADER_BYTES}");
            return Ok(Step::Nonsense { at, reason });
        }
        let mut head = Head {
            at,
            ..Head::default()
        };
        self.read(len, &mut head.header)?;
        let data_len = if (head.header.len() as u64) < len {
            None
        } else {
            self.length()?
        };
        let Some(data_len) = data_len else {
            return Ok(Step::Torn { at, head: None });
        };
        head.data_at = self.next;
        head.data_len = data_len;
        self.next += data_len;
        if self.next > self.end {
            return Ok(Step::Torn {
                at,
                head: Some(head),
            });
        }
        Ok(Step::Record(head))
    }

    /// Reads the data of the record `head`, or fewer at the end of the file.
    pub(super) fn data(&mut self, head: &Head, into: &mut Vec<u8>) -> io::Result<()> {
        self.go_to(head.data_at)?;
        self.read(head.data_len, into)
    }

    fn go_to_next(&mut self) -> io::Result<()> {
        let here = self.file.stream_position()?;
        // Stays within the buffer if possible: most records are short.
        self.file
            .seek_relative((self.next.cast_signed()).wrapping_sub(here.cast_signed()))
    }

    fn length(&mut self) -> io::Result<Option<u64>> {
        let mut bytes = Vec::new();
        self.read(4, &mut bytes)?;
        Ok(bytes.try_into().ok().map(u32::from_le_bytes).map(u64::from))
    }
}
