//! Flow of samples through a stage: count, rate and age.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Averaging time of rates; a table that changes faster cannot be read.
const WINDOW: Duration = Duration::from_secs(3);
/// Shortest time between two counts that are stored within [`WINDOW`].
const APART: Duration = Duration::from_millis(100);

/// Flow of samples through one stage.
#[derive(Debug)]
pub struct Flow {
    began: Instant,
    /// Time of the last known increase of the count.
    newest: Option<Instant>,
    counts: VecDeque<(Instant, u64)>,
    count: u64,
}

impl Flow {
    /// Creates a flow without samples.
    pub fn new(began: Instant) -> Self {
        Self {
            began,
            newest: None,
            counts: VecDeque::from([(began, 0)]),
            count: 0,
        }
    }

    /// Sets the number of samples so far; returns whether it has increased.
    pub fn note(&mut self, count: u64, now: Instant) -> bool {
        let grew = count > self.count;
        if grew {
            self.newest = Some(now);
        }
        self.count = count;
        let is_due = |(last, _): &(Instant, u64)| now.duration_since(*last) >= APART;
        if self.counts.back().is_none_or(is_due) {
            self.counts.push_back((now, count));
        }
        while self.counts.len() > 2 && now.duration_since(self.counts[1].0) >= WINDOW {
            self.counts.pop_front();
        }
        grew
    }

    /// Returns the number of samples so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Returns the sample rate \[Hz\].
    pub fn rate_hz(&self, now: Instant) -> f64 {
        let Some(&(since, before)) = self.counts.front() else {
            return 0.0;
        };
        let seconds = now.duration_since(since).as_secs_f64();
        self.count.saturating_sub(before) as f64 / seconds.max(f64::MIN_POSITIVE)
    }

    /// Returns the time since the newest sample; `None` before the first one.
    pub fn age(&self, now: Instant) -> Option<Duration> {
        self.newest.map(|newest| now.duration_since(newest))
    }

    /// Returns the time since the newest sample, or since the start before the first one.
    pub fn silent_for(&self, now: Instant) -> Duration {
        now.duration_since(self.newest.unwrap_or(self.began))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_that_of_the_last_seconds_and_the_age_that_of_the_newest() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut flow = Flow::new(start);
        for tick in 1..=100_u64 {
            assert!(flow.note(tick * 50, at(tick * 100)));
        }
        assert!((flow.rate_hz(at(10_000)) - 500.0).abs() < 20.0);
        for tick in 101..=150_u64 {
            assert!(!flow.note(5000, at(tick * 100)));
        }
        assert!(flow.rate_hz(at(15_000)) < 1.0);
        assert_eq!(flow.age(at(15_000)), Some(Duration::from_secs(5)));
        assert!(flow.counts.len() < 50, "bounded");
    }

    #[test]
    fn what_never_came_has_no_age_but_is_silent() {
        let start = Instant::now();
        let flow = Flow::new(start);
        let now = start + Duration::from_secs(7);
        assert_eq!(flow.age(now), None);
        assert_eq!(flow.silent_for(now), Duration::from_secs(7));
    }
}
