//! Rate at which a score exceeds a threshold by chance.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Length of the blocks whose largest scores are used \[s\].
/// Statistical: twice the correlation time of 0.5 s of the residual after the baseline is subtracted, so that blocks
/// are nearly independent.
pub(super) const BLOCK_S: f64 = 1.0;
/// Share of the blocks above the level; the tail is estimated from them.
/// Chosen: near the upper tenth of `DuMouchel` (Annals of Statistics 11, 1983). A smaller share leaves fewer than
/// three peaks in 20 s, a larger one fits the body of the distribution.
const ABOVE: f64 = 0.15;
/// Scale of the tail if there are too few blocks to estimate it, as a share of the root of the largest score.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const FEW: f64 = 0.25;
/// Prior of the tail's shape.
/// Derived: the mean of the prior of Martins and Stedinger (2000), a beta distribution from -0.5 to 0.5.
const USUAL_SHAPE: f64 = 0.1;
/// Weight of this prior, as a number of peaks.
/// Derived: about 90 peaks give a shape by probability-weighted moments the standard deviation of that prior, 0.12
/// (Hosking and Wallis 1987).
const USUAL_PEAKS: f64 = 100.0;
/// Largest absolute value of an estimated shape, before the prior is included.
/// Derived: the range of that prior; above it the variance of the estimate is not finite.
const FOUND: f64 = 0.5;
/// Lower limit of a mean of peaks, in standard deviations: the mean is below it once in ten times.
/// Statistical: the 90 % quantile of the normal distribution.
const LIMIT: f64 = 1.28;
/// Bounds of the tail's shape: 0 is exponential, above 0 the tail is heavier.
/// Derived: from the exponential, as a few peaks do not determine a finite end point, to the 95 % quantile of that
/// prior, 0.29.
const SHAPE: [f64; 2] = [0.0, 0.3];

/// Tail of a score's distribution. The square roots of the largest scores of blocks of one second, above a level,
/// follow a generalised Pareto distribution (Coles, "An Introduction to Statistical Modeling of Extreme Values",
/// 2001, section 4.2).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tail {
    /// Level, as a square root of a score.
    pub level: f64,
    /// Peaks above the level per hour.
    pub per_hour: f64,
    /// Scale of the generalised Pareto distribution.
    pub scale: f64,
    /// Shape of the generalised Pareto distribution: 0 is exponential, above 0 the tail is heavier.
    pub shape: f64,
}

/// Collects the largest score of each block.
#[derive(Debug, Default)]
pub(crate) struct Peaks(Vec<(i64, f64)>);

impl Peaks {
    /// Takes the next score.
    pub fn add(&mut self, stamp_ns: i64, score: f64) {
        let block = stamp_ns.div_euclid((BLOCK_S * 1e9) as i64);
        match self.0.last_mut() {
            Some((last, peak)) if *last == block => *peak = peak.max(score),
            _ => self.0.push((block, score)),
        }
    }

    /// Returns the largest score of each block.
    pub fn into_blocks(self) -> Vec<f64> {
        self.0.into_iter().map(|(_, peak)| peak).collect()
    }
}

impl Tail {
    /// Fits the tail to the largest score of each block, in order of time.
    ///
    /// Consecutive blocks above the level are one peak (Coles 2001, section 5.3.2). Few peaks determine a tail
    /// poorly. So its shape is shrunk towards a prior (as Martins and Stedinger 2000 do), and its scale is an upper
    /// confidence limit.
    pub(crate) fn new(mut blocks: Vec<f64>) -> Self {
        for score in &mut blocks {
            *score = score.max(0.0).sqrt();
        }
        Self::of_roots(&blocks, &mut Vec::with_capacity(blocks.len()))
    }

    /// Fits the tail to the square roots of these scores, without an allocation if `scratch` has room for them.
    pub(super) fn of_roots(blocks: &[f64], scratch: &mut Vec<f64>) -> Self {
        let count = blocks.len().max(1);
        scratch.clear();
        scratch.extend_from_slice(blocks);
        scratch.sort_unstable_by(f64::total_cmp);
        let above = ((count as f64 * ABOVE) as usize).max(1);
        let level = scratch
            .len()
            .checked_sub(above + 1)
            .map_or(0.0, |at| scratch[at]);
        let of_run = |run: &[f64]| run.iter().fold(0.0, |a, b| f64::max(a, b - level));
        let runs = blocks.split(|score| *score <= level);
        scratch.clear();
        scratch.extend(runs.filter(|run| !run.is_empty()).map(of_run));
        scratch.sort_unstable_by(f64::total_cmp);
        let excess = scratch;
        // Probability-weighted moments (Hosking and Wallis 1987): a0 = E X, a1 = E X (1 - F).
        let n = excess.len().max(1) as f64;
        let a0 = excess.iter().sum::<f64>() / n;
        let weighted = excess.iter().enumerate();
        let a1 = weighted
            .map(|(i, x)| x * (1.0 - (i as f64 + 0.65) / n))
            .sum::<f64>()
            / n;
        let found = if a0 > 2.0 * a1 + 1e-12 {
            (2.0 - a0 / (a0 - 2.0 * a1)).clamp(-FOUND, FOUND)
        } else {
            FOUND
        };
        let shape = (n * found + USUAL_PEAKS * USUAL_SHAPE) / (n + USUAL_PEAKS);
        let shape = shape.clamp(SHAPE[0], SHAPE[1]);
        Self {
            level,
            per_hour: n / count as f64 * 3600.0 / BLOCK_S,
            scale: (a0 * (1.0 - shape) / lower_limit(n)).max(1e-9),
            shape,
        }
    }

    /// Returns the tail for blocks that are too few to estimate one. It is exponential above the largest of them, or
    /// above the score that one of a thousand samples exceeds (the unit of a score). The rate of false alarms is no
    /// more than a guess then.
    pub(crate) fn of_few(blocks: &[f64]) -> Self {
        let level = blocks.iter().fold(1.0, |a, b| f64::max(a, *b)).sqrt();
        Self {
            level,
            per_hour: 3600.0 / BLOCK_S / blocks.len().max(1) as f64,
            scale: FEW * level,
            shape: 0.0,
        }
    }

    /// Returns the score that chance exceeds in `per_hour` blocks an hour.
    pub fn threshold(&self, per_hour: f64) -> f64 {
        let ratio = (self.per_hour / per_hour).max(1.0);
        let above = if self.shape < 1e-6 {
            ratio.ln()
        } else {
            (ratio.powf(self.shape) - 1.0) / self.shape
        };
        (self.level + self.scale * above).powi(2)
    }
}

/// Returns the lower limit that the mean of this number of exponential peaks of scale 1 falls below once in ten times
/// (Wilson and Hilferty 1931).
fn lower_limit(peaks: f64) -> f64 {
    let share = (9.0 * peaks).recip();
    (1.0 - share - LIMIT * share.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks whose roots are exponential above 1 with scale 0.5.
    fn exponential(count: usize) -> Vec<f64> {
        (0..count)
            .map(|i| {
                // Each block once, large ones apart from each other.
                let survival = 1.0 - ((i * 1013 % count) as f64 + 0.5) / count as f64;
                (1.0 - 0.5 * survival.ln()).powi(2)
            })
            .collect()
    }

    #[test]
    fn the_threshold_keeps_the_wish_and_is_hardly_higher_after_an_hour() {
        let tail = Tail::new(exponential(3600));
        // One in 3600 blocks: 1 + 0.5 ln 3600.
        let expected = (1.0 + 0.5 * 3600.0_f64.ln()).powi(2);
        let found = tail.threshold(1.0);
        assert!(
            (1.0..1.2).contains(&(found / expected)),
            "{found} {expected}"
        );
    }

    #[test]
    fn the_less_was_seen_the_higher_is_the_threshold() {
        let after = |count| Tail::new(exponential(count)).threshold(5.0);
        assert!(
            after(60) > 1.2 * after(3600),
            "{} {}",
            after(60),
            after(3600)
        );
    }

    #[test]
    fn a_stricter_wish_gives_a_higher_threshold() {
        let tail = Tail::new(exponential(600));
        assert!(tail.threshold(0.006) > tail.threshold(1.0));
        assert!(tail.threshold(1.0) > tail.threshold(60.0));
    }
}
