//! All terms of a robot together: from the rigid body's effort to the recorded one.

use super::{Layer, MotionSample, Term};

/// Terms in the order in which they act: bodies, joints, recording.
#[derive(Debug, Default)]
pub struct Physics {
    terms: Vec<Box<dyn Term>>,
    /// Number of terms of [`Layer::Body`].
    bodies: usize,
    transmitted: Vec<f64>,
}

impl Physics {
    /// Puts the terms in order, for a robot of `joint_count` joints.
    pub fn new(mut terms: Vec<Box<dyn Term>>, joint_count: usize) -> Self {
        terms.sort_by_key(|term| term.effect().layer);
        let before = |layer: Layer| terms.iter().filter(|t| t.effect().layer < layer).count();
        Self {
            bodies: before(Layer::Joint),
            terms,
            transmitted: vec![0.0; joint_count],
        }
    }

    /// The terms in the order in which they act.
    pub fn terms(&self) -> &[Box<dyn Term>] {
        &self.terms
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.terms.is_empty()
    }

    /// Forgets what came before: a new recording or a gap.
    pub fn reset(&mut self) {
        for term in &mut self.terms {
            term.reset();
        }
    }

    /// Turns `effort`, the rigid body's at this instant, into what is recorded \[N m or N\]; to be called
    /// once per sample. [`MotionSample::transmitted`] is passed over: it is `effort` as it comes. Does not
    /// allocate.
    pub fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let (bodies, rest) = self.terms.split_at_mut(self.bodies);
        self.transmitted.copy_from_slice(effort);
        let rigid = MotionSample {
            transmitted: &self.transmitted,
            ..*at
        };
        for term in bodies {
            term.act(&rigid, effort);
        }
        self.transmitted.copy_from_slice(effort);
        let at = MotionSample {
            transmitted: &self.transmitted,
            ..*at
        };
        for term in rest {
            term.act(&at, effort);
        }
    }
}
