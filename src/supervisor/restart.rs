//! Restart delays of stages that failed.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use tauscope_pipeline::pipeline::{Restart, When};

/// Recent failures of one stage.
#[derive(Debug, Default)]
pub struct Deaths {
    recent: VecDeque<Instant>,
}

impl Deaths {
    /// Notes a failure, and returns the delay before the restart: none the first time, longer the more often the
    /// stage fails. `None` if it fails too often for `policy`.
    pub fn note(&mut self, policy: &Restart, now: Instant) -> Option<Duration> {
        if policy.when == When::Never {
            return None;
        }
        let window = Duration::from_secs_f64(policy.within_s);
        self.recent.push_back(now);
        while self
            .recent
            .front()
            .is_some_and(|&first| now.duration_since(first) > window)
        {
            self.recent.pop_front();
        }
        let before = u32::try_from(self.recent.len() - 1).unwrap_or(u32::MAX);
        if before >= policy.most {
            return None;
        }
        let Some(doublings) = before.checked_sub(1) else {
            return Some(Duration::ZERO);
        };
        // More doublings exceed any longest delay.
        let wait_s = policy.wait_s * f64::from(1_u32 << doublings.min(31));
        Some(Duration::from_secs_f64(wait_s.min(policy.longest_wait_s)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waits(policy: &Restart, deaths: u64) -> Vec<Option<u128>> {
        let start = Instant::now();
        let mut noted = Deaths::default();
        (0..deaths)
            .map(|second| noted.note(policy, start + Duration::from_secs(second)))
            .map(|wait| wait.map(|wait| wait.as_millis()))
            .collect()
    }

    #[test]
    fn a_stage_is_started_at_once_then_later_then_no_more() {
        let waits = waits(&Restart::default(), 5);
        assert_eq!(waits, [Some(0), Some(50), Some(100), Some(200), None]);
    }

    #[test]
    fn the_file_says_whether_how_often_and_how_late() {
        let never = Restart {
            when: When::Never,
            ..Restart::default()
        };
        assert_eq!(waits(&never, 1), [None]);
        let patient = Restart {
            most: 50,
            within_s: 1000.0,
            wait_s: 1.0,
            longest_wait_s: 3.0,
            ..Restart::default()
        };
        let waits = waits(&patient, 50);
        assert_eq!(waits[..4], [Some(0), Some(1000), Some(2000), Some(3000)]);
        assert_eq!(waits[49], Some(3000));
    }

    #[test]
    fn deaths_long_ago_are_forgotten() {
        let start = Instant::now();
        let mut deaths = Deaths::default();
        for hour in 0..100 {
            let at = start + Duration::from_secs(3600 * hour);
            assert_eq!(deaths.note(&Restart::default(), at), Some(Duration::ZERO));
        }
    }
}
