//! A delay line for the efforts of one joint or of all.

use super::{Effect, MotionSample, Site, Term};

/// Number of samples in memory: enough for a second at 1 kHz.
/// Resolution: memory; the longest delay searched is 1 s, and a denser recording is interpolated.
const CAPACITY: usize = 1024;

/// Delayed efforts, linearly interpolated between samples. Before the first sample its value is held.
#[derive(Debug)]
pub(super) struct DelayLine {
    delay_s: f64,
    joint_count: usize,
    /// Time since the reset \[s\].
    now_s: f64,
    /// Ring buffer of times and, joint by joint, of efforts.
    times_s: Vec<f64>,
    efforts: Vec<f64>,
    /// Number of samples stored since the reset.
    stored: usize,
    /// Oldest sample that may still be needed; it only increases.
    oldest: usize,
}

impl DelayLine {
    /// Creates a line for the efforts of `joint_count` joints; a negative delay is treated as zero \[s\].
    pub(super) fn new(joint_count: usize, delay_s: f64) -> Self {
        Self {
            delay_s: delay_s.max(0.0),
            joint_count,
            now_s: 0.0,
            times_s: vec![0.0; CAPACITY],
            efforts: vec![0.0; CAPACITY * joint_count],
            stored: 0,
            oldest: 0,
        }
    }

    /// Changes the delay \[s\]; a negative delay is treated as zero.
    pub(super) fn set_delay(&mut self, delay_s: f64) {
        self.delay_s = delay_s.max(0.0);
    }

    /// Clears the memory.
    pub(super) fn reset(&mut self) {
        self.now_s = 0.0;
        self.stored = 0;
        self.oldest = 0;
    }

    /// Stores the efforts of the next instant and replaces them by the delayed ones.
    pub(super) fn pass(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        self.now_s += at.dt_s.max(0.0);
        self.store(effort);
        let wanted_s = self.now_s - self.delay_s;
        self.oldest = self.oldest.max((self.stored).saturating_sub(CAPACITY));
        while self.oldest + 2 < self.stored && self.time_s(self.oldest + 1) <= wanted_s {
            self.oldest += 1;
        }
        let (before, after) = (self.oldest, (self.oldest + 1).min(self.stored - 1));
        let (t0, t1) = (self.time_s(before), self.time_s(after));
        let share = if t1 > t0 {
            ((wanted_s - t0) / (t1 - t0)).clamp(0.0, 1.0)
        } else {
            1.0
        };
        let n = self.joint_count;
        let (before, after) = ((before % CAPACITY) * n, (after % CAPACITY) * n);
        for (j, effort) in effort.iter_mut().enumerate() {
            let (e0, e1) = (self.efforts[before + j], self.efforts[after + j]);
            *effort = e0 + (e1 - e0) * share;
        }
    }

    fn time_s(&self, index: usize) -> f64 {
        self.times_s[index % CAPACITY]
    }

    fn store(&mut self, effort: &[f64]) {
        // If more samples fall within the delay than fit into the ring, some are not stored but interpolated
        // linearly. Of three samples the first and last are at least this far apart.
        let finest_s = 2.0 * self.delay_s / (CAPACITY - 4) as f64;
        let index = match self.stored {
            // The newest sample is always stored; the next one overwrites it if it comes too soon.
            n if n >= 2 && self.now_s - self.time_s(n - 2) < finest_s => n - 1,
            n => {
                self.stored += 1;
                n
            }
        };
        let at = index % CAPACITY;
        self.times_s[at] = self.now_s;
        self.efforts[at * self.joint_count..][..self.joint_count].copy_from_slice(effort);
    }
}

/// A term that delays the recorded effort of one joint, or of all. Its only coordinate is the delay \[s\].
#[derive(Debug)]
pub(super) struct Delayed {
    effect: &'static Effect,
    /// The delayed joint; `None` for all.
    joint: Option<usize>,
    values: [f64; 1],
    line: DelayLine,
}

impl Delayed {
    /// Creates the term of `effect` for a joint, or for all joints of the robot at `site`.
    pub fn boxed(
        effect: &'static Effect,
        site: &Site<'_>,
        joint: Option<usize>,
        values: [f64; 1],
    ) -> Box<dyn Term> {
        let joint_count = joint.map_or(site.model.dof(), |_| 1);
        Box::new(Self {
            effect,
            joint,
            values,
            line: DelayLine::new(joint_count, values[0]),
        })
    }
}

impl Term for Delayed {
    fn effect(&self) -> &'static Effect {
        self.effect
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.line.reset();
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        match self.joint {
            Some(joint) => {
                let own = std::slice::from_mut(&mut effort[joint]);
                self.line.pass(at, own);
            }
            None => self.line.pass(at, effort),
        }
    }
}
