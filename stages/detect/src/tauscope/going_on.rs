//! Estimates the threshold again from contact-free time while the detector runs.
//!
//! A minute of contact-free data contains few peaks, so the threshold is higher than necessary ([`Tail`] uses the
//! upper confidence limit of the tail). Each further hour without contacts makes the estimate more precise. The
//! threshold learnt from data that are known to be contact-free is an upper bound. Otherwise light contacts that
//! raise no alarm would raise the threshold.

use std::collections::VecDeque;

use tauscope_bus::TwinState;

use super::learnt::Learnt;
use super::stand::STILL_RAD_S;
use super::tail::{BLOCK_S, Tail};

/// Number of blocks that are kept.
/// Statistical: an hour suffices for a threshold of five false alarms an hour; older blocks may no longer represent
/// the arm.
const REMEMBERED: usize = 3600;
/// Minimum number of blocks to estimate the tail, and (`AGAIN`) number of new blocks between two estimates.
/// Statistical: 18 of 120 blocks are above the level, and the relative standard error of their mean is a quarter.
const LEAST: usize = 120;
const AGAIN: usize = 60;

/// Largest score of each block in which the arm moved.
#[derive(Debug)]
pub(super) struct GoingOn {
    /// Learnt threshold, and its number of false alarms per hour.
    most: f64,
    per_hour: f64,
    /// Square roots of the largest scores.
    blocks: VecDeque<f64>,
    scratch: Vec<f64>,
    /// Present block: its number, largest score, samples and samples in motion.
    block: i64,
    peak: f64,
    samples: usize,
    moving: usize,
    /// Whether there is an alarm in the present block, and whether there was one in the block before.
    alarm: bool,
    was_alarm: bool,
    /// Blocks since the last estimate of the threshold.
    since_told: usize,
}

impl GoingOn {
    /// Starts from the learnt state, for `per_hour` false alarms an hour.
    pub fn new(learnt: &Learnt, per_hour: f64) -> Self {
        let mut blocks = VecDeque::with_capacity(REMEMBERED);
        let newest = learnt.peaks_since.len().saturating_sub(REMEMBERED);
        blocks.extend(learnt.peaks_since[newest..].iter().copied().map(f64::from));
        Self {
            most: learnt.tail.threshold(per_hour),
            per_hour,
            blocks,
            scratch: Vec::with_capacity(REMEMBERED),
            block: i64::MIN,
            peak: 0.0,
            samples: 0,
            moving: 0,
            alarm: false,
            was_alarm: false,
            since_told: 0,
        }
    }

    /// Returns the peaks, to be kept for the next run.
    pub fn peaks(&self) -> Vec<f32> {
        self.blocks.iter().map(|root| *root as f32).collect()
    }

    /// Takes the next score and, during an alarm, the threshold at which the alarm was raised.
    pub fn add(&mut self, sample: &TwinState, joints: usize, score: f64, alarm: Option<f64>) {
        let block = sample.header.stamp_ns.div_euclid((BLOCK_S * 1e9) as i64);
        if block != self.block {
            self.end_block(block);
        }
        self.samples += 1;
        let speeds = sample.velocity[..joints].iter().map(|v| v.abs());
        self.moving += usize::from(speeds.fold(0.0, f64::max) > STILL_RAD_S);
        match alarm {
            // A false alarm is a peak of at least the threshold; a contact must not count for more.
            Some(threshold) if !self.alarm => (self.peak, self.alarm) = (threshold, true),
            None if !self.alarm => self.peak = self.peak.max(score),
            _ => {}
        }
    }

    fn end_block(&mut self, next: i64) {
        // The peaks of a stationary arm do not represent a moving one, so it must move for half of a block.
        // A contact is one peak: the block after one with an alarm may contain its end and does not count.
        if 2 * self.moving > self.samples && !self.was_alarm {
            if self.blocks.len() == REMEMBERED {
                self.blocks.pop_front();
            }
            self.blocks.push_back(self.peak.max(0.0).sqrt());
            self.since_told += 1;
        }
        (self.was_alarm, self.alarm) = (self.alarm, false);
        (self.block, self.peak) = (next, 0.0);
        (self.samples, self.moving) = (0, 0);
    }

    /// Returns whether the threshold should be estimated again.
    pub fn is_due(&self) -> bool {
        self.since_told >= AGAIN && self.blocks.len() >= LEAST
    }

    /// Estimates the threshold from all peaks so far.
    pub fn threshold(&mut self) -> f64 {
        self.since_told = 0;
        if self.blocks.len() < LEAST {
            return self.most;
        }
        let tail = Tail::of_roots(self.blocks.make_contiguous(), &mut self.scratch);
        tail.threshold(self.per_hour).min(self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLES: i64 = 10;
    const MOST: f64 = 64.0;

    /// State learnt from one minute, with [`MOST`] as its threshold.
    fn learnt() -> Learnt {
        Learnt {
            rate_hz: 10.0,
            joints: Vec::new(),
            windows: Vec::new(),
            rest: None,
            tail: Tail {
                level: MOST.sqrt(),
                per_hour: 1.0,
                scale: 1.0,
                shape: 0.0,
            },
            peaks_since: Vec::new(),
            free_s: Some(60.0),
            smallest: Vec::new(),
            kinds: None,
            kind_contacts: None,
        }
    }

    /// Returns the threshold after this number of blocks with these scores; `alarms` gives the threshold of a block
    /// with an alarm.
    fn after(
        blocks: usize,
        velocity: f64,
        score: impl Fn(usize) -> f64,
        alarms: impl Fn(usize) -> Option<f64>,
    ) -> f64 {
        let mut going_on = GoingOn::new(&learnt(), 5.0);
        for k in 0..blocks as i64 * SAMPLES {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k * 1_000_000_000 / SAMPLES;
            sample.velocity[0] = velocity;
            let block = (k / SAMPLES) as usize;
            going_on.add(&sample, 1, score(block), alarms(block));
        }
        let next = Learnt {
            peaks_since: going_on.peaks(),
            ..learnt()
        };
        let of_next_life = GoingOn::new(&next, 5.0).threshold();
        assert!((of_next_life / going_on.threshold() - 1.0).abs() < 1e-6);
        of_next_life
    }

    /// Roots of scores that are exponential above 1 with scale 0.5.
    fn usual(block: usize) -> f64 {
        let survival = 1.0 - ((block * 1013 % 3600) as f64 + 0.5) / 3600.0;
        (1.0 - 0.5 * survival.ln()).powi(2)
    }

    #[test]
    fn an_hour_of_usual_motion_tells_the_threshold_that_it_needs() {
        // One in 720 blocks: 1 + 0.5 ln 720.
        let expected = (1.0 + 0.5 * 720.0_f64.ln()).powi(2);
        let found = after(3700, 0.5, usual, |_| None) / expected;
        assert!((0.95..1.2).contains(&found), "{found}");
    }

    #[test]
    fn less_than_two_minutes_of_motion_and_a_standing_arm_tell_nothing() {
        for (blocks, velocity) in [(100, 0.5), (3700, 0.0)] {
            let found = after(blocks, velocity, usual, |_| None);
            assert!((found - MOST).abs() < 1e-9, "{found}");
        }
    }

    #[test]
    fn the_more_alarms_the_higher_is_the_threshold_up_to_what_was_learnt() {
        let every = |alarms: usize| {
            let alarm = |block: usize| block.is_multiple_of(alarms).then_some(30.0);
            after(3600, 0.5, usual, alarm)
        };
        let none = after(3600, 0.5, usual, |_| None);
        assert!(none < every(100), "{none} {}", every(100));
        assert!(every(100) < every(10), "{} {}", every(100), every(10));
        assert!(every(10) <= MOST, "{}", every(10));
    }
}
