//! The baseline gain, which a change reaches by chance, and the threshold that follows from it.

use super::moments::{JOINT_KINDS, Reference};
use super::scale::Scale;

/// Ratio of a change's gain to its baseline gain above which the change is reported.
/// Statistical: 6.3 standard deviations of one Gaussian number; seven joints (29 kinds), 29 instants and 7200 blocks
/// an hour exceed it at most once in 600 h by chance (Bonferroni). Residuals are not Gaussian, hence the factors
/// below.
pub(super) const BEYOND: f64 = 40.0;
/// Relative increase of the threshold for a baseline gain from one independent window. It is inversely proportional
/// to the number of windows.
/// Tuned: by hand, on no recorded seeds; not swept.
const INEXPERIENCE: f64 = 4.0;
/// Minimum ratio of a reported gain to the largest gain without a change.
/// Tuned: by hand, on no recorded seeds; not swept.
const OVER_LARGEST: f64 = 2.0;
/// Relative increase of the threshold if all motion is novel. It is proportional to the share of novel motion.
/// Tuned: by hand, on no recorded seeds; not swept.
const NOVELTY: f64 = 12.0;

/// References, baseline gains and noise with which changes are compared.
pub(super) struct Usual<'a> {
    pub references: &'a [Reference],
    pub scales: &'a [[Scale; JOINT_KINDS]],
    pub floors: &'a [f64],
    pub noise: &'a [Option<f64>],
    pub payload: &'a Scale,
    pub caution: f64,
    /// Running mean of the share of joints whose motion is novel.
    pub unlike: f64,
}

impl Usual<'_> {
    /// Returns the gain above which a change is reported; `usual` is its baseline gain and `novel` the share of novel
    /// motion.
    pub fn threshold(&self, scale: &Scale, usual: f64, novel: f64) -> f64 {
        let beyond = usual
            * BEYOND
            * self.caution
            * (1.0 + INEXPERIENCE / scale.independent())
            * (1.0 + NOVELTY * novel.max(self.unlike));
        beyond.max(OVER_LARGEST * self.caution * scale.largest())
    }
}
