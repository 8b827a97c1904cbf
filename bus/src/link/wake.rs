//! Wake-up mode of a receiver.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Wake-up mode of a receiver in shared memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wake {
    /// Notification by the sender, at the cost of a system call for each sample and receiver.
    #[default]
    Event,
    /// Polling at this interval \[ms\]. The sender has no extra cost, and one poll reads several samples.
    EveryMs(u64),
    /// Polling at this interval \[ms\], and a notification by the sender for an urgent sample
    /// ([`Sample::is_urgent`](crate::Sample::is_urgent)) of a stream that may carry alarms.
    EveryMsOrUrgent(u64),
    /// Busy polling: the lowest latency, at the cost of a core.
    Spin,
}

impl Wake {
    /// Polling interval, if the mode polls.
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
