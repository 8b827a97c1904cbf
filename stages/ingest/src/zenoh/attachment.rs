//! Attachments of `rmw_zenoh` to its messages, from whose sequence numbers lost messages are counted.

use std::collections::BTreeMap;

use super::waiting::Role;

/// Maximum number of publishers remembered; a restarted node has another id.
/// Resolution: memory.
const MAX_PUBLISHERS: usize = 256;

/// Sequence number and publisher of a message. The bytes are a little-endian i64 sequence number, an i64
/// source time \[ns\], the length 16, and 16 bytes of publisher id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attachment {
    pub sequence: i64,
    pub publisher: [u8; 16],
}

impl Attachment {
    /// Parses an attachment; returns `None` if the bytes are something else.
    pub fn parse(bytes: &[u8]) -> Option<Self> {
        let (sequence, rest) = bytes.split_first_chunk::<8>()?;
        let (_source_time, rest) = rest.split_first_chunk::<8>()?;
        let (&16, publisher) = rest.split_first()? else {
            return None;
        };
        Some(Self {
            sequence: i64::from_le_bytes(*sequence),
            publisher: publisher.try_into().ok()?,
        })
    }
}

/// Counts the gaps in the publishers' sequence numbers.
#[derive(Debug, Default)]
pub(super) struct Losses {
    next: BTreeMap<(Role, [u8; 16]), i64>,
    lost: u64,
}

impl Losses {
    /// Records a message. Numbers that decrease mean a restarted publisher.
    pub fn count(&mut self, role: Role, attachment: Attachment) {
        let key = (role, attachment.publisher);
        if !self.next.contains_key(&key) && self.next.len() >= MAX_PUBLISHERS {
            self.next.clear();
        }
        let next = attachment.sequence.saturating_add(1);
        if let Some(expected) = self.next.insert(key, next) {
            let hole = attachment.sequence.saturating_sub(expected);
            self.lost += u64::try_from(hole).unwrap_or(0);
        }
    }

    pub fn lost(&self) -> u64 {
        self.lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bytes(sequence: i64, publisher: u8) -> Vec<u8> {
        let mut bytes = sequence.to_le_bytes().to_vec();
        bytes.extend(1_700_000_000_i64.to_le_bytes());
        bytes.push(16);
        bytes.extend([publisher; 16]);
        bytes
    }

    #[test]
    fn holes_are_counted_by_publisher_and_topic() {
        let mut losses = Losses::default();
        for (role, sequence, publisher) in [
            (Role::State, 10, 1),
            (Role::State, 11, 1),
            (Role::State, 0, 2),
            (Role::Command, 5, 1),
            (Role::State, 15, 1),
            (Role::State, 2, 2),
            (Role::State, 0, 1),
            (Role::State, 1, 1),
        ] {
            let attachment = Attachment::parse(&bytes(sequence, publisher)).unwrap();
            losses.count(role, attachment);
        }
        assert_eq!(losses.lost(), 3 + 1);
    }

    #[test]
    fn what_is_no_attachment_of_rmw_zenoh_is_left_alone() {
        assert_eq!(Attachment::parse(b""), None);
        assert_eq!(Attachment::parse(&bytes(1, 1)[..32]), None);
        let mut other = bytes(1, 1);
        other[16] = 8;
        assert_eq!(Attachment::parse(&other), None);
    }
}
