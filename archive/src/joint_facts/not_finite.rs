//! Values of a joint that are NaN or infinite: their field, number and times.

use std::fmt;

use serde::Serialize;

/// Fields of a joint, in the order of the messages.
pub const FIELDS: [&str; 3] = ["position", "velocity", "effort"];

/// A field of a joint that is not finite in some messages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NotFinite {
    /// `position`, `velocity` or `effort`.
    pub field: &'static str,
    /// Number of messages in which it is not finite.
    pub messages: u64,
    /// Number of messages that have the field.
    pub of: u64,
    /// Whether some of these values are infinite.
    pub infinite: bool,
    /// Time of the first value that is not finite, from the first message of the topic \[s\].
    pub first_s: f64,
    /// Time of the last value that is not finite, from the first message of the topic \[s\].
    pub last_s: f64,
}

impl NotFinite {
    /// Describes the fault, with the name of the joint.
    pub fn in_words(&self, joint: &str) -> String {
        format!("the {} of {joint} {self}", self.field)
    }
}

/// Kind, number and times of the values: `is NaN in 12 messages from 3.200 s to 3.310 s`.
impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (count, first_s, last_s) = (self.messages, self.first_s, self.last_s);
        let what = if self.infinite {
            "NaN or infinite"
        } else {
            "NaN"
        };
        match count {
            all if all == self.of => write!(f, "is {what} in every message"),
            1 => write!(f, "is {what} in 1 message at {first_s:.3} s"),
            _ => write!(
                f,
                "is {what} in {count} messages from {first_s:.3} s to {last_s:.3} s"
            ),
        }
    }
}

/// Running counts of one field of one joint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FieldTally {
    given: u64,
    bad: u64,
    infinite: bool,
    /// Stamps of the first and the last value that is not finite \[ns\].
    span_ns: (i64, i64),
}

impl FieldTally {
    /// Adds a value. Returns whether it is the first that is not finite.
    pub fn add(&mut self, stamp_ns: i64, value: f64) -> bool {
        self.given += 1;
        if value.is_finite() {
            return false;
        }
        self.bad += 1;
        self.infinite |= value.is_infinite();
        if self.bad == 1 {
            self.span_ns.0 = stamp_ns;
        }
        self.span_ns.1 = stamp_ns;
        self.bad == 1
    }

    /// Returns whether there were values and none of them was finite.
    pub fn is_never_finite(&self) -> bool {
        self.given > 0 && self.bad == self.given
    }

    /// Returns the summary, with times relative to `first_ns`; `None` if all values were finite.
    pub fn found(&self, field: &'static str, first_ns: i64) -> Option<NotFinite> {
        let since = |ns: i64| (ns - first_ns) as f64 * 1e-9;
        (self.bad > 0).then(|| NotFinite {
            field,
            messages: self.bad,
            of: self.given,
            infinite: self.infinite,
            first_s: since(self.span_ns.0),
            last_s: since(self.span_ns.1),
        })
    }
}
