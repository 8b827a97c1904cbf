//! `sensor_msgs/msg/JointState`.

use std::collections::BTreeMap;

use byteorder::ByteOrder;
use cdr_encoding::CdrDeserializer;
use serde::{Deserialize, Serialize};

use super::cdr::MAX_PADDING;
use super::header::{HEADER, Header, TIME, Time};
use super::{DecodeError, Message};

/// `sensor_msgs/msg/JointState`: position \[rad or m\], velocity \[rad/s or m/s\] and effort
/// \[N m, N, or A with some drivers\] of named joints, in no fixed order. Each array is empty or as
/// long as `name`. Entries may be NaN.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointState {
    /// Time of the measurement.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Their positions, or empty.
    pub position: Vec<f64>,
    /// Their velocities, or empty.
    pub velocity: Vec<f64>,
    /// Their efforts, or empty.
    pub effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";
    const TEXT: &'static str = "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
                                float64[] velocity\nfloat64[] effort\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[HEADER, TIME];
    const TYPE_HASH: &'static str =
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()?;
        for (array, len) in [
            ("position", self.position.len()),
            ("velocity", self.velocity.len()),
            ("effort", self.effort.len()),
        ] {
            if len != 0 && self.name.is_empty() {
                return Err(DecodeError::NoNames { array, len });
            }
            if len != 0 && len != self.name.len() {
                return Err(DecodeError::array_length(array, len, &self.name));
            }
        }
        Ok(())
    }

    // Joint states arrive up to a thousand times a second.
    fn read_alike(&mut self, fields: &[u8]) -> bool {
        self.read_numbers(&mut Walk { fields, at: 0 }).is_some()
    }

    // Field by field, so that the existing memory is reused.
    fn read<BO: ByteOrder>(
        &mut self,
        from: &mut CdrDeserializer<'_, BO>,
    ) -> Result<(), cdr_encoding::Error> {
        self.header.stamp = Time::deserialize(&mut *from)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.header.frame_id)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.name)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.position)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.velocity)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.effort)
    }
}

impl JointState {
    /// Returns the first two indices in `name` of the first joint that occurs more than once. Its values are
    /// ambiguous.
    pub fn named_twice(&self) -> Option<[usize; 2]> {
        first_twice(&self.name)
    }

    /// Reads the stamp and the numbers of a message with the frame and the joints of `self`. Returns `None` if they
    /// differ, or if the length does not match the counts.
    fn read_numbers(&mut self, from: &mut Walk<'_>) -> Option<()> {
        self.header.stamp = Time {
            sec: from.word()?.cast_signed(),
            nanosec: from.word()?,
        };
        from.pass(&self.header.frame_id)?;
        if from.word()? as usize != self.name.len() {
            return None;
        }
        self.name.iter().try_for_each(|name| from.pass(name))?;
        from.numbers(&mut self.position)?;
        from.numbers(&mut self.velocity)?;
        from.numbers(&mut self.effort)?;
        (from.fields.len() - from.at <= MAX_PADDING).then_some(())
    }
}

/// Cursor over the fields of a little-endian message.
struct Walk<'a> {
    fields: &'a [u8],
    at: usize,
}

impl Walk<'_> {
    fn take(&mut self, alignment: usize, len: usize) -> Option<&[u8]> {
        let at = self.at.next_multiple_of(alignment);
        let taken = self.fields.get(at..)?.get(..len)?;
        self.at = at + len;
        Some(taken)
    }

    fn word(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4, 4)?.try_into().ok()?))
    }

    /// Skips a string that equals `text`.
    fn pass(&mut self, text: &str) -> Option<()> {
        let len = self.word()? as usize;
        let (nul, bytes) = self.take(1, len)?.split_last()?;
        (*nul == 0 && bytes == text.as_bytes()).then_some(())
    }

    fn numbers(&mut self, into: &mut Vec<f64>) -> Option<()> {
        let count = self.word()? as usize;
        into.clear();
        if count > 0 {
            let (numbers, _) = self.take(8, count.checked_mul(8)?)?.as_chunks();
            into.extend(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)));
        }
        Some(())
    }
}

/// Returns the first two indices of the first name that occurs more than once.
pub fn first_twice(names: &[String]) -> Option<[usize; 2]> {
    let mut seen = BTreeMap::new();
    let mut places = names.iter().enumerate();
    places.find_map(|(at, name)| seen.insert(name, at).map(|first| [first, at]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use super::super::{decode, decode_into, encode};
    use super::*;

    fn state(names: &[&str], value: f64) -> JointState {
        let numbers = vec![value; names.len()];
        JointState {
            header: Header::new(1_500_000_000, "base"),
            name: names.iter().map(|&name| name.to_owned()).collect(),
            position: numbers.clone(),
            velocity: Vec::new(),
            effort: numbers,
        }
    }

    fn body(state: &JointState) -> Vec<u8> {
        let mut body = Vec::new();
        encode(state, &mut body).unwrap();
        body
    }

    #[test]
    fn what_is_read_does_not_depend_on_the_message_before() {
        let messages = [
            state(&["a", "bc"], 1.0),
            state(&["a", "bc"], f64::INFINITY),
            state(&["a", "bd"], 2.0),
            state(&["a"], 3.0),
            state(&[], 4.0),
            state(&["a", "bc"], -0.0),
        ];
        let mut read = JointState::default();
        for message in &messages {
            decode_into(&body(message), &mut read).unwrap();
            assert_eq!(&read, message);
        }
    }

    #[test]
    fn neither_does_what_is_refused() {
        let whole = body(&state(&["a", "bc"], 1.0));
        for len in 0..whole.len() + 9 {
            let mut bytes = whole.clone();
            bytes.resize(len, 0);
            for flipped in 0..len {
                let mut bytes = bytes.clone();
                bytes[flipped] ^= 0x81;
                let mut again = state(&["a", "bc"], 7.0);
                let again = decode_into(&bytes, &mut again).map(|()| again);
                let anew = decode::<JointState>(&bytes);
                // By their text: a flipped bit may make a NaN.
                assert_eq!(format!("{again:?}"), format!("{anew:?}"));
            }
        }
    }
}
