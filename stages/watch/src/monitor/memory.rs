//! Saving and restoring of the learnt state.

use super::super::blocks::Known;
use super::super::memory::{Memory, OfJoint};
use super::super::moments::{Moments, Reference};
use super::{Monitor, Phase};

impl Monitor {
    /// Returns the learnt state.
    pub fn memory(&self) -> Memory {
        let joints = (0..self.references.len()).map(|j| OfJoint {
            moments: self.references[j].moments.numbers(),
            known: self.known[j].told(),
            scales: self.scales[j],
            loudness: self.loudness[j],
        });
        Memory {
            joints: joints.collect(),
            payload: self.payload,
        }
    }

    /// Restores the learnt state of an earlier run and starts watching, if the state fits the number of joints.
    pub fn resume(&mut self, memory: &Memory) {
        if !memory.fits(self.references.len()) {
            return;
        }
        for (j, joint) in memory.joints.iter().enumerate() {
            let moments = Moments::of_numbers(&joint.moments).unwrap_or(Moments::ZERO);
            self.references[j] = Reference::of(moments);
            self.known[j] = Known::of_told(&joint.known);
            self.scales[j] = joint.scales;
            self.loudness[j] = joint.loudness;
        }
        self.payload = memory.payload;
        self.settle();
        self.phase = Phase::Watching;
    }
}
