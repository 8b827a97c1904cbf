//! Baseline gains: the gain that a change reaches by chance, learnt from the stream itself.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum weight of a running mean \[windows\]. One window ends with each block, so this is 20 minutes of motion.
/// Physical: arms warm up within about 20 minutes.
const MEMORY: f64 = 2400.0;
/// Minimum number of short windows for a baseline gain.
/// Derived: as many as fit into one long window without overlap.
const LEAST_SHORT: f64 = (Scale::LONG / Scale::SHORT) as f64;
/// Minimum number of long windows for a baseline gain.
/// Derived: a mean needs one value.
const LEAST_LONG: f64 = 1.0;

/// A running mean that becomes an exponentially weighted one after [`MEMORY`] values.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Mean {
    pub value: f64,
    pub count: f64,
}

impl Mean {
    pub fn take(&mut self, value: f64) {
        self.count = (self.count + 1.0).min(MEMORY);
        self.value += (value - self.value) / self.count;
    }

    /// Limits the weight of the past to that of `count` values.
    pub fn weigh(&mut self, count: f64) {
        self.count = self.count.min(count);
    }
}

/// The gain of a change in windows without one. It exceeds that of white noise, and grows with the length of the
/// window, if the residual is correlated or if the twin has errors that the reference does not contain.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Scale {
    short: Mean,
    long: Mean,
    /// Largest gain without a change, over all instants of change.
    largest: f64,
}

impl Scale {
    /// Length of a short window \[blocks\]: 2 s of motion.
    /// Tuned: by hand, on no recorded seeds; not swept.
    pub const SHORT: usize = 4;
    /// Length of a long window \[blocks\]: 8 s of motion.
    /// Chosen: the length of the windows of a report, 13 to 18 blocks.
    pub const LONG: usize = 16;

    /// Adds the gain of the change in a window of this length.
    pub fn take(&mut self, blocks: usize, gain: f64) {
        if blocks == Self::SHORT {
            self.short.take(gain);
        } else {
            self.long.take(gain);
        }
    }

    /// Adds the largest gain over all instants in motion without a change. Twin errors in some phases of a motion and
    /// slow drift recur, and may then be slightly larger.
    pub fn take_largest(&mut self, gain: f64) {
        self.largest = (self.largest * (1.0 - PEAK_DECAY)).max(gain);
    }

    /// Returns the largest gain without a change; see [`Scale::take_largest`].
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// Limits the weight of the past to that of `windows` windows.
    pub fn weigh(&mut self, windows: f64) {
        self.short.weigh(windows);
        self.long.weigh(windows);
    }

    /// Returns the baseline gain: the larger of the means over short and long windows. `None` before there are enough
    /// windows.
    pub fn usual(&self) -> Option<f64> {
        (self.short.count >= LEAST_SHORT && self.long.count >= LEAST_LONG)
            .then(|| self.short.value.max(self.long.value))
    }

    /// Returns the number of long windows without overlap behind the baseline gain.
    pub fn independent(&self) -> f64 {
        (self.long.count + Self::LONG as f64 - 1.0) / Self::LONG as f64
    }
}

/// Energy per row of a joint's residual in a block after the reference is subtracted: mean and largest value.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Loudness {
    mean: Mean,
    peak: f64,
}

/// Ratio of a block's energy to the mean above which the block is loud.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER_MEAN: f64 = 40.0;
/// Ratio of a loud block's energy to the largest energy so far that it must also exceed.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER_PEAK: f64 = 4.0;
/// Decay of the largest value per block: to half in an hour of 7200 blocks.
/// Chosen: a louder block that recurs within the hour is not reported again; a slower decay would hide contacts for
/// longer.
const PEAK_DECAY: f64 = 1e-4;
/// Minimum number of blocks behind the mean before a block can be loud.
/// Statistical: the mean energy of 80 rows of white noise has a standard error of √(2 / 80) = 16 %.
const LEAST_BLOCKS: f64 = 8.0;

impl Loudness {
    pub fn take(&mut self, energy_per_row: f64) {
        self.mean.take(energy_per_row);
        self.grow_used_to(energy_per_row);
    }

    /// Raises the largest energy: a block as loud as this one is not loud again.
    pub fn grow_used_to(&mut self, energy_per_row: f64) {
        self.peak = (self.peak * (1.0 - PEAK_DECAY)).max(energy_per_row);
    }

    /// Limits the weight of the past to that of `blocks` blocks.
    pub fn weigh(&mut self, blocks: f64) {
        self.mean.weigh(blocks);
    }

    /// Returns whether a block with this energy is loud; the mean is raised to at least `floor`.
    pub fn is_beyond(&self, energy_per_row: f64, floor: f64) -> bool {
        self.mean.count >= LEAST_BLOCKS
            && energy_per_row > OVER_MEAN * self.mean.value.max(floor)
            && energy_per_row > OVER_PEAK * self.peak
    }
}
