//! What is usual: how much a change explains by chance, learned from the stream itself.

/// What was learned weighs as much as so many windows at most: 20 minutes of motion.
const MEMORY: f64 = 2400.0;

/// A running mean that becomes an exponential one.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mean {
    pub value: f64,
    pub count: f64,
}

impl Mean {
    pub fn take(&mut self, value: f64) {
        self.count = (self.count + 1.0).min(MEMORY);
        self.value += (value - self.value) / self.count;
    }

    /// Lets the past weigh as much as `count` values at most.
    pub fn weigh(&mut self, count: f64) {
        self.count = self.count.min(count);
    }
}

/// What a change explains in windows without one. Where the residual is coloured or the twin off in ways that
/// the reference does not hold, that is more than the noise says, and the more the longer the window is.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Scale {
    short: Mean,
    long: Mean,
    /// The most that it explained since any instant of change.
    largest: f64,
}

impl Scale {
    /// Windows in blocks.
    pub const SHORT: usize = 4;
    pub const LONG: usize = 16;

    /// Takes what the change explains in a window of so many blocks.
    pub fn take(&mut self, blocks: usize, gain: f64) {
        if blocks == Self::SHORT {
            self.short.take(gain);
        } else {
            self.long.take(gain);
        }
    }

    /// Takes the most that the change explains since any instant: a twin that is off in some phases of a
    /// motion, or an arm that creeps, is no change when it comes back a little stronger.
    pub fn take_largest(&mut self, gain: f64) {
        self.largest = (self.largest * (1.0 - PEAK_DECAY)).max(gain);
    }

    /// See [`Scale::take_largest`].
    pub fn largest(&self) -> f64 {
        self.largest
    }

    pub fn weigh(&mut self, windows: f64) {
        self.short.weigh(windows);
        self.long.weigh(windows);
    }

    /// What is usual; `None` before enough was seen.
    pub fn usual(&self) -> Option<f64> {
        (self.short.count >= 4.0 && self.long.count >= 1.0)
            .then(|| self.short.value.max(self.long.value))
    }

    /// How many long windows it rests on that hold nothing in common.
    pub fn independent(&self) -> f64 {
        (self.long.count + Self::LONG as f64 - 1.0) / Self::LONG as f64
    }
}

/// The energy that is left of a joint's residual in a block: its mean and its largest.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Loudness {
    mean: Mean,
    peak: f64,
}

/// A block is loud from so many times the usual energy on, and so many times the largest.
const OVER_MEAN: f64 = 40.0;
const OVER_PEAK: f64 = 4.0;
/// The largest is forgotten at this share a block: half in an hour.
const PEAK_DECAY: f64 = 1e-4;

impl Loudness {
    pub fn take(&mut self, energy_per_row: f64) {
        self.mean.take(energy_per_row);
        self.grow_used_to(energy_per_row);
    }

    /// What came once does not startle again.
    pub fn grow_used_to(&mut self, energy_per_row: f64) {
        self.peak = (self.peak * (1.0 - PEAK_DECAY)).max(energy_per_row);
    }

    pub fn weigh(&mut self, blocks: f64) {
        self.mean.weigh(blocks);
    }

    /// Whether so much is far beyond what is usual, which is at least `floor`.
    pub fn is_beyond(&self, energy_per_row: f64, floor: f64) -> bool {
        self.mean.count >= 8.0
            && energy_per_row > OVER_MEAN * self.mean.value.max(floor)
            && energy_per_row > OVER_PEAK * self.peak
    }
}
