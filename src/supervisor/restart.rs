//! When a stage that died is started again.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A stage that dies this often within [`WINDOW`] is not started again.
pub const MOST_DEATHS: usize = 5;
/// See [`MOST_DEATHS`].
pub const WINDOW: Duration = Duration::from_secs(10);
/// Wait before the second start within [`WINDOW`]; doubled for each one more.
const FIRST_WAIT: Duration = Duration::from_millis(50);

/// The deaths of one stage.
#[derive(Debug, Default)]
pub struct Deaths {
    recent: VecDeque<Instant>,
}

impl Deaths {
    /// Notes a death, and says after what time to start the stage again: at once the first time,
    /// later the more often it dies; `None` if it dies too often.
    pub fn note(&mut self, now: Instant) -> Option<Duration> {
        self.recent.push_back(now);
        while self
            .recent
            .front()
            .is_some_and(|&first| now.duration_since(first) > WINDOW)
        {
            self.recent.pop_front();
        }
        match self.recent.len() {
            MOST_DEATHS.. => None,
            0 | 1 => Some(Duration::ZERO),
            count => Some(FIRST_WAIT * (1 << (count - 2))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_started_at_once_then_later_then_no_more() {
        let start = Instant::now();
        let mut deaths = Deaths::default();
        let waits: Vec<_> = (0..5)
            .map(|second| deaths.note(start + Duration::from_secs(second)))
            .collect();
        let ms = Duration::from_millis;
        assert_eq!(
            waits,
            [
                Some(ms(0)),
                Some(ms(50)),
                Some(ms(100)),
                Some(ms(200)),
                None
            ]
        );
    }

    #[test]
    fn deaths_long_ago_are_forgotten() {
        let start = Instant::now();
        let mut deaths = Deaths::default();
        for hour in 0..100 {
            let at = start + Duration::from_secs(3600 * hour);
            assert_eq!(deaths.note(at), Some(Duration::ZERO));
        }
    }
}
