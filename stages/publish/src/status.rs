//! What the outputs show: the alarm, and how old it is.

use std::time::{Duration, Instant};

use crate::message::{AlarmMessage, AlarmState};

/// The alarm at the newest detection, and when that came.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// As of the newest detection.
    pub alarm: AlarmMessage,
    /// The touched link in the order of the URDF, from 1; 0 for none.
    pub link_number: u16,
    /// Detections so far.
    pub detections: u64,
    /// When the detector that was heard longest ago was heard; `None` before each has been.
    pub heard: Option<Instant>,
    stop_after: Duration,
}

impl Status {
    /// Before anything was heard.
    pub fn silent(stop_after: Duration) -> Self {
        Self {
            alarm: AlarmMessage::silent(),
            link_number: 0,
            detections: 0,
            heard: None,
            stop_after,
        }
    }

    /// How old it is; `None` before each detector was heard.
    pub fn age(&self, now: Instant) -> Option<Duration> {
        self.heard.map(|heard| now.saturating_duration_since(heard))
    }

    /// What it says at the instant `now`: when it is too old, that nothing is known.
    pub fn at(&self, now: Instant) -> AlarmMessage {
        if self.age(now).is_some_and(|age| age <= self.stop_after) {
            return self.alarm.clone();
        }
        AlarmMessage {
            state: AlarmState::Silent,
            free: false,
            ..self.alarm.clone()
        }
    }
}
