//! Packages of RTDE: a big-endian length of 16 bits that includes itself, a letter, and the body. Pure.
//!
//! Universal Robots, "Real-Time Data Exchange (RTDE) Guide", protocol version 2.

/// Letter of a request for a protocol version, and of its answer.
pub(super) const VERSION: u8 = b'V';
/// Letter of a recipe of outputs, and of its answer.
pub(super) const OUTPUTS: u8 = b'O';
/// Letter of the request to start, and of its answer.
pub(super) const START: u8 = b'S';
/// Letter of a package of data.
pub(super) const DATA: u8 = b'U';
/// Letter of a text message.
pub(super) const TEXT: u8 = b'M';
/// All letters of the protocol.
const LETTERS: &[u8] = b"VvMUOISPR";
const HEADER_BYTES: usize = 3;

/// Bytes that are not a package.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Nonsense {
    /// The first bytes.
    pub beginning: Vec<u8>,
}

/// Returns a package with this letter. Requests are far shorter than the format allows.
pub(super) fn package(letter: u8, body: &[u8]) -> Vec<u8> {
    let len = u16::try_from(HEADER_BYTES + body.len()).unwrap_or(u16::MAX);
    let mut bytes = len.to_be_bytes().to_vec();
    bytes.push(letter);
    bytes.extend_from_slice(body);
    bytes
}

/// Splits a stream of bytes into packages. It holds at most one package and the bytes read after it.
#[derive(Debug, Default)]
pub(super) struct Packages {
    bytes: Vec<u8>,
}

impl Packages {
    /// Adds received bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Takes the next complete package: its letter and its body.
    ///
    /// # Errors
    /// If the bytes belong to another protocol; the stream cannot be read any further.
    pub fn take(&mut self) -> Result<Option<(u8, Vec<u8>)>, Nonsense> {
        let Some(&[high, low, letter]) = self.bytes.first_chunk::<HEADER_BYTES>() else {
            return Ok(None);
        };
        let len = usize::from(u16::from_be_bytes([high, low]));
        if len < HEADER_BYTES || !LETTERS.contains(&letter) {
            const SHOWN: usize = 16;
            let beginning = self.bytes[..self.bytes.len().min(SHOWN)].to_vec();
            return Err(Nonsense { beginning });
        }
        if self.bytes.len() < len {
            return Ok(None);
        }
        let body = self.bytes[HEADER_BYTES..len].to_vec();
        self.bytes.drain(..len);
        Ok(Some((letter, body)))
    }
}

/// Returns the text of a text message, whose body is the length, the text, and the sender.
pub(super) fn text(body: &[u8]) -> String {
    let len = body.first().map_or(0, |&len| usize::from(len));
    let text = body.get(1..).unwrap_or_default();
    String::from_utf8_lossy(&text[..text.len().min(len)]).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_come_out_however_they_are_cut() {
        let stream = [package(VERSION, &[1]), package(DATA, &[1, 2, 3])].concat();
        for step in 1..=stream.len() {
            let mut packages = Packages::default();
            let mut found = Vec::new();
            for piece in stream.chunks(step) {
                packages.push(piece);
                while let Ok(Some(package)) = packages.take() {
                    found.push(package);
                }
            }
            assert_eq!(found, [(VERSION, vec![1]), (DATA, vec![1, 2, 3])]);
            assert!(packages.bytes.is_empty());
        }
    }

    #[test]
    fn another_protocol_is_noticed_at_once() {
        for bytes in [b"HTTP/1.1 400".as_slice(), b"\0\x02V", b"\0\x05?12"] {
            let mut packages = Packages::default();
            packages.push(bytes);
            let beginning = bytes.to_vec();
            assert_eq!(packages.take(), Err(Nonsense { beginning }));
        }
    }

    #[test]
    fn a_text_may_lie_about_its_length() {
        assert_eq!(text(b"\x05hello\x03abc\x01"), "hello");
        assert_eq!(text(b"\xffhi"), "hi");
        assert_eq!(text(b""), "");
    }
}
