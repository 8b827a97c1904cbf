//! What is usual, and how far beyond it a change must be to be told.

use super::moments::{JOINT_KINDS, Reference};
use super::scale::Scale;

/// A change is told from so many times what is usual on (about six standard deviations), and from more
/// while what is usual rests on few windows.
pub(super) const BEYOND: f64 = 40.0;
const INEXPERIENCE: f64 = 4.0;
/// Nor is a change what explains less than so many times the most it ever did without one.
const OVER_LARGEST: f64 = 2.0;
/// How much more where the motion is unlike all that the reference has seen.
const NOVELTY: f64 = 12.0;

/// What is usual, and what must be known to judge.
pub(super) struct Usual<'a> {
    pub references: &'a [Reference],
    pub scales: &'a [[Scale; JOINT_KINDS]],
    pub floors: &'a [f64],
    pub noise: &'a [Option<f64>],
    pub payload: &'a Scale,
    pub caution: f64,
    /// Share of joints that lately moved unlike ever before.
    pub unlike: f64,
}

impl Usual<'_> {
    /// What a change must explain to be told.
    pub fn threshold(&self, scale: &Scale, usual: f64, novel: f64) -> f64 {
        let beyond = usual
            * BEYOND
            * self.caution
            * (1.0 + INEXPERIENCE / scale.independent())
            * (1.0 + NOVELTY * novel.max(self.unlike));
        beyond.max(OVER_LARGEST * self.caution * scale.largest())
    }
}
