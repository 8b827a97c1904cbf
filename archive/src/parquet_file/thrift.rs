//! Reader of Thrift's compact protocol
//! (<https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>), the encoding of footers and
//! page headers. It reads from a byte slice and allocates no memory.

/// Maximum nesting depth of structs and lists.
/// Resolution: bounds the stack; footers have 7.
const MAX_DEPTH: usize = 32;

/// Field types of the compact protocol. A boolean field has its value as its type.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const I16: u8 = 4;
const I32: u8 = 5;
const I64: u8 = 6;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const MAP: u8 = 11;
const STRUCT: u8 = 12;

/// Truncated or malformed data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Broken;

/// Cursor over the encoded bytes.
#[derive(Debug)]
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    pub(super) at: usize,
}

/// A field of a struct: its number and its type.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    pub(super) id: i16,
    kind: u8,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    fn byte(&mut self) -> Result<u8, Broken> {
        let byte = self.bytes.get(self.at).copied().ok_or(Broken)?;
        self.at += 1;
        Ok(byte)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], Broken> {
        let end = self.at.checked_add(count).ok_or(Broken)?;
        let taken = self.bytes.get(self.at..end).ok_or(Broken)?;
        self.at = end;
        Ok(taken)
    }

    fn varint(&mut self) -> Result<u64, Broken> {
        // LEB128: seven bits per byte, least significant first; the high bit marks a continuation.
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(Broken)
    }

    fn zigzag(&mut self) -> Result<i64, Broken> {
        let value = self.varint()?;
        // 0, 1, 2, 3 encode 0, -1, 1, -2, so that small negative numbers are short.
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    /// Calls `each` for every field of the struct at the current position. `each` must read the field or
    /// [`Reader::skip`] it.
    pub(super) fn fields(
        &mut self,
        mut each: impl FnMut(&mut Self, Field) -> Result<(), Broken>,
    ) -> Result<(), Broken> {
        let mut id: i16 = 0;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            // The upper half is the distance to the previous field id; 0 if the id follows in full.
            let step = i16::from(head >> 4);
            id = if step == 0 {
                i16::try_from(self.zigzag()?).map_err(|_| Broken)?
            } else {
                id.checked_add(step).ok_or(Broken)?
            };
            let kind = head & 0x0f;
            each(self, Field { id, kind })?;
        }
    }

    /// An integer of any width.
    pub(super) fn integer(&mut self, field: Field) -> Result<i64, Broken> {
        match field.kind {
            BYTE => Ok(i64::from(self.byte()? as i8)),
            I16 | I32 | I64 => self.zigzag(),
            _ => Err(Broken),
        }
    }

    pub(super) fn boolean(field: Field) -> Result<bool, Broken> {
        match field.kind {
            TRUE => Ok(true),
            FALSE => Ok(false),
            _ => Err(Broken),
        }
    }

    pub(super) fn text(&mut self, field: Field) -> Result<&'a [u8], Broken> {
        if field.kind != BINARY {
            return Err(Broken);
        }
        let length = self.varint()?;
        self.take(usize::try_from(length).map_err(|_| Broken)?)
    }

    /// Calls `each` for every struct of the list at the current position.
    pub(super) fn structs(
        &mut self,
        field: Field,
        mut each: impl FnMut(&mut Self) -> Result<(), Broken>,
    ) -> Result<(), Broken> {
        if field.kind != LIST {
            return Err(Broken);
        }
        let (count, kind) = self.list()?;
        if kind != STRUCT {
            return Err(Broken);
        }
        (0..count).try_for_each(|_| each(self))
    }

    pub(super) fn is_struct(field: Field) -> Result<(), Broken> {
        if field.kind == STRUCT {
            Ok(())
        } else {
            Err(Broken)
        }
    }

    /// Reads the length and the element type of a list. The length is bounded by the bytes left, since no element is
    /// shorter than a byte.
    fn list(&mut self) -> Result<(usize, u8), Broken> {
        let head = self.byte()?;
        let short = usize::from(head >> 4);
        let count = if short == 15 {
            usize::try_from(self.varint()?).map_err(|_| Broken)?
        } else {
            short
        };
        if count > self.bytes.len() - self.at {
            return Err(Broken);
        }
        Ok((count, head & 0x0f))
    }

    /// Skips the field.
    pub(super) fn skip(&mut self, field: Field) -> Result<(), Broken> {
        match field.kind {
            TRUE | FALSE => Ok(()),
            kind => self.skip_value(kind, 0),
        }
    }

    fn skip_value(&mut self, kind: u8, depth: usize) -> Result<(), Broken> {
        if depth > MAX_DEPTH {
            return Err(Broken);
        }
        match kind {
            TRUE | FALSE | BYTE => self.byte().map(|_| ()),
            I16 | I32 | I64 => self.varint().map(|_| ()),
            DOUBLE => self.take(8).map(|_| ()),
            BINARY => {
                let length = self.varint()?;
                let length = usize::try_from(length).map_err(|_| Broken)?;
                self.take(length).map(|_| ())
            }
            LIST | SET => {
                let (count, kind) = self.list()?;
                (0..count).try_for_each(|_| self.skip_value(kind, depth + 1))
            }
            MAP => {
                let count = self.varint()?;
                if count == 0 {
                    return Ok(());
                }
                let kinds = self.byte()?;
                for _ in 0..count {
                    self.skip_value(kinds >> 4, depth + 1)?;
                    self.skip_value(kinds & 0x0f, depth + 1)?;
                }
                Ok(())
            }
            STRUCT => self.fields(|reader, field| match field.kind {
                TRUE | FALSE => Ok(()),
                kind => reader.skip_value(kind, depth + 1),
            }),
            _ => Err(Broken),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use super::*;

    #[test]
    fn fields_are_read_and_others_skipped() {
        // Field 1: i32 -3; field 2: "ab"; field 4: list of two i32; field 5: true; end.
        let bytes = [0x15, 5, 0x18, 2, b'a', b'b', 0x29, 0x25, 2, 4, 0x11, 0];
        let mut reader = Reader::new(&bytes);
        let (mut number, mut text, mut flag) = (0, Vec::new(), false);
        let read = reader.fields(|reader, field| {
            match field.id {
                1 => number = reader.integer(field)?,
                2 => text = reader.text(field)?.to_vec(),
                5 => flag = Reader::boolean(field)?,
                _ => reader.skip(field)?,
            }
            Ok(())
        });
        read.unwrap();
        assert_eq!((number, text.as_slice(), flag), (-3, &b"ab"[..], true));
        assert_eq!(reader.at, bytes.len());
    }

    #[test]
    fn nothing_longer_than_the_bytes_is_believed() {
        // A list of 2^31 structs in four bytes; a text of 2^40 bytes; lists in lists without end.
        for bytes in [
            &[0x19, 0xfc, 0xff, 0xff, 0xff, 0xff, 0x07, 0][..],
            &[0x18, 0xff, 0xff, 0xff, 0xff, 0xff, 0x3f, 0],
            &[0x19; 200],
            &[0x1c; 200],
        ] {
            let mut reader = Reader::new(bytes);
            let read = reader.fields(Reader::skip);
            assert_eq!(read, Err(Broken), "{bytes:?}");
        }
    }
}
