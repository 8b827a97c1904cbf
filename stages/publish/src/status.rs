//! Status on the outputs: the alarm and its age.

use std::time::{Duration, Instant};

use crate::alarm::State;
use crate::message::{AlarmMessage, AlarmState};

/// The alarm at the newest detection, and the arrival time of the detections.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// The alarm at the newest detection.
    pub alarm: AlarmMessage,
    /// The touched link in the order of the URDF, from 1; 0 for none.
    pub link_number: u16,
    /// Number of detections so far.
    pub detections: u64,
    /// Last arrival from the detector that has been silent longest; `None` before each detector has sent a detection.
    pub heard: Option<Instant>,
    /// Time at which the current collision was latched, acknowledged or not.
    latched: Option<Instant>,
    stop_after: Duration,
}

impl Status {
    /// Creates the status before the first detection.
    pub fn silent(stop_after: Duration) -> Self {
        Self {
            alarm: AlarmMessage::silent(),
            link_number: 0,
            detections: 0,
            heard: None,
            latched: None,
            stop_after,
        }
    }

    /// Returns the age of the alarm; `None` before each detector has sent a detection.
    pub fn age(&self, now: Instant) -> Option<Duration> {
        self.heard.map(|heard| now.saturating_duration_since(heard))
    }

    /// Records the state of the alarm at `now`. A collision after an acknowledged one is a new latch.
    pub fn latch(&mut self, state: State, now: Instant) {
        let is_new = state == State::Collision && self.alarm.state == AlarmState::Acknowledged;
        let is_latched = matches!(state, State::Collision | State::Acknowledged);
        let before = self.latched.filter(|_| !is_new);
        self.latched = is_latched.then(|| before.unwrap_or(now));
    }

    /// Returns the alarm at the instant `now`. If it is too old, its state is silent and not free; a latch remains.
    pub fn at(&self, now: Instant) -> AlarmMessage {
        let is_fresh = self.age(now).is_some_and(|age| age <= self.stop_after);
        let latched = self
            .latched
            .map(|since| now.saturating_duration_since(since));
        let alarm = AlarmMessage {
            latched_for_ms: latched.map(|age| u64::try_from(age.as_millis()).unwrap_or(u64::MAX)),
            ..self.alarm.clone()
        };
        if is_fresh {
            return alarm;
        }
        AlarmMessage {
            state: AlarmState::Silent,
            free: false,
            ..alarm
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_latch_ages_through_silence_and_acknowledgement_until_it_is_released_or_comes_again() {
        let begin = Instant::now();
        let at = |s| begin + Duration::from_secs(s);
        let mut status = Status::silent(Duration::from_secs(1));
        let mut told = |state: State, s| {
            status.latch(state, at(s));
            status.alarm.state = AlarmState::from(state);
            status.heard = Some(at(s));
            // Half a minute later nothing has been heard.
            let alarm = status.at(at(s + 30));
            assert_eq!(alarm.state, AlarmState::Silent);
            alarm.latched_for_ms
        };
        assert_eq!(told(State::Free, 0), None);
        assert_eq!(told(State::Collision, 10), Some(30_000));
        assert_eq!(told(State::Collision, 20), Some(40_000));
        assert_eq!(told(State::Acknowledged, 30), Some(50_000));
        assert_eq!(told(State::Collision, 40), Some(30_000));
        assert_eq!(told(State::Free, 50), None);
    }
}
