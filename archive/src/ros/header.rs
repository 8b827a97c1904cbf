//! `builtin_interfaces/msg/Time` and `std_msgs/msg/Header`.

use serde::{Deserialize, Serialize};

use super::DecodeError;

const NS_PER_S: i64 = 1_000_000_000;

pub(super) const HEADER: (&str, &str) = (
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
);
pub(super) const TIME: (&str, &str) = ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");

/// `builtin_interfaces/msg/Time`: time since the epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Time {
    /// Whole seconds.
    pub sec: i32,
    /// And nanoseconds, below 10⁹.
    pub nanosec: u32,
}

impl Time {
    /// Creates the time `ns` nanoseconds after the epoch, clamped to the range of the type, 1970 to 2038.
    pub fn from_ns(ns: i64) -> Self {
        let ns = ns.clamp(0, i64::from(i32::MAX) * NS_PER_S + NS_PER_S - 1);
        Self {
            sec: (ns / NS_PER_S) as i32,
            nanosec: (ns % NS_PER_S) as u32,
        }
    }

    /// Returns the nanoseconds since the epoch.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * NS_PER_S + i64::from(self.nanosec)
    }

    /// Checks that it is not before the epoch, and has less than a second of nanoseconds.
    pub(super) fn check(self) -> Result<(), DecodeError> {
        if self.sec < 0 || i64::from(self.nanosec) >= NS_PER_S {
            return Err(DecodeError::Stamp {
                sec: self.sec,
                nanosec: self.nanosec,
            });
        }
        Ok(())
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Header {
    /// Time of the measurement.
    pub stamp: Time,
    /// Frame of the data.
    pub frame_id: String,
}

impl Header {
    /// A header with the stamp `ns` and the frame `frame_id`.
    pub fn new(ns: i64, frame_id: &str) -> Self {
        Self {
            stamp: Time::from_ns(ns),
            frame_id: frame_id.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_holds_what_it_can() {
        assert_eq!(
            Time::from_ns(1_500_000_000),
            Time {
                sec: 1,
                nanosec: 500_000_000
            }
        );
        assert_eq!(Time::from_ns(-1).ns(), 0);
        assert_eq!(Time::from_ns(i64::MAX).sec, i32::MAX);
    }
}
