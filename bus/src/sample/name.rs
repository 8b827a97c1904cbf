//! Names in samples.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// A short text of fixed size, UTF-8, zero-padded.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq, Hash, Pod, Zeroable, ZeroCopySend)]
pub struct Name {
    bytes: [u8; Name::CAPACITY],
}

impl Name {
    /// Longest text \[bytes\].
    /// Resolution: size of a sample; longer names are cut.
    pub const CAPACITY: usize = 48;

    /// Creates a name from `text`, cut after the last character that fits.
    pub fn new(text: &str) -> Self {
        let mut end = text.len().min(Self::CAPACITY);
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        let mut bytes = [0; Self::CAPACITY];
        bytes[..end].copy_from_slice(&text.as_bytes()[..end]);
        Self { bytes }
    }

    /// The text, up to the first byte that is not valid UTF-8.
    pub fn as_str(&self) -> &str {
        let end = self
            .bytes
            .iter()
            .position(|&b| b == 0)
            .unwrap_or(Self::CAPACITY);
        match std::str::from_utf8(&self.bytes[..end]) {
            Ok(text) => text,
            Err(error) => std::str::from_utf8(&self.bytes[..error.valid_up_to()]).unwrap_or(""),
        }
    }
}

impl Default for Name {
    fn default() -> Self {
        Self {
            bytes: [0; Self::CAPACITY],
        }
    }
}

impl From<&str> for Name {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl std::fmt::Debug for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.as_str().fmt(f)
    }
}

impl std::fmt::Display for Name {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.as_str().fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_cut_at_a_character() {
        assert_eq!(Name::new("twin_regression").as_str(), "twin_regression");
        let long = "ä".repeat(40);
        assert_eq!(Name::new(&long).as_str(), "ä".repeat(24));
        assert_eq!(Name::default().as_str(), "");
    }
}
