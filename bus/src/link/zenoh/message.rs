//! Encoding of the messages on the network.

use crate::sample::Sample;

/// Attachment of a message of samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Beside {
    /// Session epoch of the sender.
    pub instance: u64,
    /// Sequence number of the oldest sample still available.
    pub since: u64,
    /// Number of samples lost right before the first one.
    pub gap: u64,
    /// Number of samples in all earlier sessions of the sender.
    pub former: u64,
}

impl Beside {
    pub(super) fn bytes(self) -> [u8; 32] {
        bytes([self.instance, self.since, self.gap, self.former])
    }

    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let [instance, since, gap, former] = numbers(bytes)?;
        Some(Self {
            instance,
            since,
            gap,
            former,
        })
    }
}

/// An acknowledgement from a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Taken {
    /// Session epoch of the sender.
    pub instance: u64,
    /// Sequence number expected next.
    pub next: u64,
    /// Number of samples before `next` that are lost, within this session of the sender.
    pub lost: u64,
    /// Reason of the acknowledgement.
    pub why: Why,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Why {
    /// Progress.
    Took,
    /// A missing sample.
    Misses,
    /// Disconnection of the receiver.
    Leaves,
}

impl Taken {
    pub(super) fn bytes(self) -> [u8; 32] {
        bytes([self.instance, self.next, self.lost, self.why as u64])
    }

    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let [instance, next, lost, why] = numbers(bytes)?;
        let mut reasons = [Why::Took, Why::Misses, Why::Leaves].into_iter();
        Some(Self {
            instance,
            next,
            lost,
            why: reasons.find(|reason| *reason as u64 == why)?,
        })
    }
}

/// Decodes the samples of a payload. The error is the length of a payload that has none.
pub(super) fn samples<T: Sample>(payload: &[u8]) -> Result<Vec<T>, usize> {
    if payload.is_empty() || !payload.len().is_multiple_of(size_of::<T>()) {
        return Err(payload.len());
    }
    let samples = payload.chunks_exact(size_of::<T>());
    Ok(samples.map(bytemuck::pod_read_unaligned).collect())
}

fn bytes<const N: usize, const BYTES: usize>(numbers: [u64; N]) -> [u8; BYTES] {
    let mut bytes = [0; BYTES];
    for (place, number) in bytes.chunks_exact_mut(8).zip(numbers) {
        place.copy_from_slice(&number.to_le_bytes());
    }
    bytes
}

fn numbers<const N: usize>(bytes: &[u8]) -> Option<[u64; N]> {
    if bytes.len() != 8 * N {
        return None;
    }
    let mut numbers = [0; N];
    for (number, place) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
        *number = u64::from_le_bytes(place.try_into().ok()?);
    }
    Some(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::JointState;

    #[test]
    fn what_is_written_is_read_and_nothing_else_is() {
        let beside = Beside {
            instance: 7,
            since: 1 << 40,
            gap: 3,
            former: 5,
        };
        assert_eq!(Beside::read(&beside.bytes()), Some(beside));
        assert_eq!(Beside::read(&[0; 8]), None);
        let taken = Taken {
            instance: 7,
            next: 9,
            lost: 2,
            why: Why::Leaves,
        };
        assert_eq!(Taken::read(&taken.bytes()), Some(taken));
        let unknown: [u8; 32] = bytes([7, 9, 2, 200]);
        assert_eq!(Taken::read(&unknown), None);
    }

    #[test]
    fn a_payload_of_another_size_holds_no_samples() {
        let two = [JointState::default(); 2];
        let bytes: &[u8] = bytemuck::cast_slice(&two);
        assert_eq!(samples::<JointState>(bytes).unwrap(), two);
        assert_eq!(samples::<JointState>(&bytes[1..]), Err(bytes.len() - 1));
        assert_eq!(samples::<JointState>(&[]), Err(0));
    }
}
