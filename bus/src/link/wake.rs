//! How a receiver learns that a sample is there.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// How a receiver in shared memory learns that a sample is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wake {
    /// The sender wakes it. That costs the sender a system call for each sample and receiver.
    #[default]
    Event,
    /// It looks at these intervals \[ms\]. The sender does not know of it, and many samples cost one look.
    EveryMs(u64),
    /// The same, but the sender of a stream that may hold an alarm wakes it for one
    /// ([`Sample::is_urgent`](crate::Sample::is_urgent)).
    EveryMsOrUrgent(u64),
    /// It looks all the time: the soonest, at the price of a core.
    Spin,
}

impl Wake {
    /// How long a receiver sleeps between two looks, if it has to look.
    pub(crate) fn pause(self) -> Option<Duration> {
        match self {
            Self::Event => None,
            Self::EveryMs(interval_ms) | Self::EveryMsOrUrgent(interval_ms) => {
                Some(Duration::from_millis(interval_ms))
            }
            Self::Spin => Some(Duration::ZERO),
        }
    }
}
