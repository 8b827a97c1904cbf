//! The usual gain of a change by chance, and the threshold that follows from it.

use super::moments::{JOINT_KINDS, Reference};
use super::scale::Scale;

/// A change is reported from this many times its usual gain on.
/// Statistical: 6.3 standard deviations of one Gaussian number; seven joints (29 kinds), 29 instants and 7200 blocks an
/// hour exceed it at most once in 600 h by chance (Bonferroni). Residuals are not Gaussian, hence the factors below.
pub(super) const BEYOND: f64 = 40.0;
/// The threshold is larger by this over the number of independent windows that the usual gain is the mean of.
/// Tuned: by hand, on no recorded seeds; not swept.
const INEXPERIENCE: f64 = 4.0;
/// The gain must also be this many times the largest gain without a change.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER_LARGEST: f64 = 2.0;
/// The threshold is larger by this times the share of novel motion.
/// Tuned: by hand, on no recorded seeds; not swept.
const NOVELTY: f64 = 12.0;

/// The references, the usual gains and the noise that changes are compared with.
pub(super) struct Usual<'a> {
    pub references: &'a [Reference],
    pub scales: &'a [[Scale; JOINT_KINDS]],
    pub floors: &'a [f64],
    pub noise: &'a [Option<f64>],
    pub payload: &'a Scale,
    pub caution: f64,
    /// Share of joints whose motion was novel lately.
    pub unlike: f64,
}

impl Usual<'_> {
    /// Gain from which on a change is reported; `usual` is its usual gain and `novel` the share of novel motion.
    pub fn threshold(&self, scale: &Scale, usual: f64, novel: f64) -> f64 {
        let beyond = usual
            * BEYOND
            * self.caution
            * (1.0 + INEXPERIENCE / scale.independent())
            * (1.0 + NOVELTY * novel.max(self.unlike));
        beyond.max(OVER_LARGEST * self.caution * scale.largest())
    }
}
