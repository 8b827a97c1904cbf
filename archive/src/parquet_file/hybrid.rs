//! Run-length encoded and bit-packed numbers (<https://parquet.apache.org/docs/file-format/data-pages/encodings/>,
//! "RLE"): levels, and indices of a dictionary.

/// Decoder of the numbers in a part of a page.
#[derive(Debug, Default, Clone)]
pub(super) struct Hybrid {
    at: usize,
    end: usize,
    width: u32,
    /// Numbers left in the current run, and their value.
    run: (u64, u32),
    /// Numbers left in the current bit-packed group, and the bit offset of the next one.
    packed: (u64, usize),
}

impl Hybrid {
    /// Creates a decoder of numbers of `width` bits each, in the bytes from `at` to `end` of a page.
    pub(super) fn new(at: usize, end: usize, width: u32) -> Self {
        Self {
            at,
            end,
            width,
            ..Self::default()
        }
    }

    /// Returns the next number; `None` at the end, or if it is malformed.
    pub(super) fn next(&mut self, page: &[u8]) -> Option<u32> {
        loop {
            if self.run.0 > 0 {
                self.run.0 -= 1;
                return Some(self.run.1);
            }
            if self.packed.0 > 0 {
                self.packed.0 -= 1;
                return self.unpack(page);
            }
            self.begin(page)?;
        }
    }

    /// Reads the header of the next run.
    fn begin(&mut self, page: &[u8]) -> Option<()> {
        let page = page.get(..self.end)?;
        let mut head: u64 = 0;
        let mut shift = 0;
        loop {
            let byte = *page.get(self.at)?;
            self.at += 1;
            head |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                break;
            }
            shift += 7;
            // A run header has at most 32 bits, which are five bytes of 7 bits.
            if shift > 28 {
                return None;
            }
        }
        // The lowest bit distinguishes bit-packed groups of eight numbers (1) from a repeated number (0). Eight
        // numbers of `width` bits are `width` bytes.
        if head & 1 == 1 {
            let groups = head >> 1;
            let bytes = usize::try_from(groups)
                .ok()?
                .checked_mul(self.width as usize)?;
            self.packed = (groups * 8, self.at * 8);
            // The last group may be cut where the page ends.
            self.at = self.at.checked_add(bytes)?.min(self.end);
        } else {
            let bytes = self.width.div_ceil(8) as usize;
            let value = page.get(self.at..self.at + bytes)?;
            let value = value
                .iter()
                .rev()
                .fold(0, |sum, byte| sum << 8 | u32::from(*byte));
            self.at += bytes;
            self.run = (head >> 1, value);
        }
        Some(())
    }

    fn unpack(&mut self, page: &[u8]) -> Option<u32> {
        let mut value = 0;
        for bit in 0..self.width {
            let at = self.packed.1;
            let byte = *page.get(..self.end)?.get(at / 8)?;
            value |= u32::from(byte >> (at % 8) & 1) << bit;
            self.packed.1 += 1;
        }
        Some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(bytes: &[u8], width: u32) -> Vec<u32> {
        let mut hybrid = Hybrid::new(0, bytes.len(), width);
        std::iter::from_fn(|| hybrid.next(bytes))
            .take(100)
            .collect()
    }

    #[test]
    fn packed_numbers_and_runs_are_read() {
        // The example of the format's own page: 0 to 7 in 3 bits.
        let packed = [0b11, 0b1000_1000, 0b1100_0110, 0b1111_1010];
        assert_eq!(all(&packed, 3), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(all(&[5 << 1, 1, 2 << 1, 0], 1), [1, 1, 1, 1, 1, 0, 0]);
        assert_eq!(all(&[2 << 1, 0x34, 0x12], 12), [0x1234, 0x1234]);
    }

    #[test]
    fn what_ends_within_is_no_number() {
        assert_eq!(all(&[0b11, 0b1000_1000], 3), [0, 1]);
        assert!(all(&[4, 1], 9).is_empty());
        assert!(all(&[0xff; 9], 3).is_empty());
        // No bits: all numbers are 0, and as many as it says.
        assert_eq!(all(&[4], 0), [0, 0]);
    }
}
