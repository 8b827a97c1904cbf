//! Messages that name a joint more than once.

use std::fmt;

use serde::Serialize;

use crate::ros::JointState;

/// A joint that messages name more than once, so that its values are ambiguous.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Twice {
    /// Its name.
    pub joint: String,
    /// Its first two entries in the first of these messages, counted from 1.
    pub entries: [usize; 2],
    /// Number of messages that name a joint more than once.
    pub messages: u64,
}

impl fmt::Display for Twice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            joint,
            entries: [first, second],
            messages,
        } = self;
        let (plural, verb) = if *messages == 1 { ("", "s") } else { ("s", "") };
        write!(
            f,
            "{messages} message{plural} name{verb} joint `{joint}` twice, as entries {first} and {second} of `name`"
        )
    }
}

/// Counter of messages that name a joint more than once.
#[derive(Debug, Default)]
pub(super) struct TwiceTally {
    /// First joint found, with the number of messages so far.
    pub found: Option<Twice>,
    /// Whether the newest message names a joint more than once.
    is_newest: bool,
}

impl TwiceTally {
    /// Adds a message. It is not searched again if it has the same names as the preceding one (`is_like_before`).
    pub fn add(&mut self, state: &JointState, is_like_before: bool) {
        if !is_like_before {
            let entries = state.named_twice();
            self.is_newest = entries.is_some();
            if let Some([first, second]) = entries {
                self.found.get_or_insert_with(|| Twice {
                    joint: state.name[first].clone(),
                    entries: [first + 1, second + 1],
                    messages: 0,
                });
            }
        }
        if let Some(twice) = self.found.as_mut().filter(|_| self.is_newest) {
            twice.messages += 1;
        }
    }
}
