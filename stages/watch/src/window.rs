//! Sums over consecutive blocks, and the gain of each change in them.

use super::blocks::Block;
use super::moments::{Compared, JointScore, Moments, Outer, OuterScore, Reference};
use super::rows::PAYLOAD;

/// Sums over blocks, by joint.
#[derive(Debug)]
pub(super) struct Window {
    pub own: Vec<Moments>,
    payload: Vec<Outer<PAYLOAD>>,
    /// Number of blocks in the window, and of those in which a joint's motion is novel, by joint.
    pub blocks: usize,
    pub novel: Vec<usize>,
}

impl Window {
    pub fn new(joints: usize) -> Self {
        Self {
            own: vec![Moments::ZERO; joints],
            payload: vec![Outer::zero(); joints],
            blocks: 0,
            novel: vec![0; joints],
        }
    }

    pub fn clear(&mut self) {
        self.own.fill(Moments::ZERO);
        self.payload.fill(Outer::zero());
        self.blocks = 0;
        self.novel.fill(0);
    }

    pub fn add(&mut self, block: &Block) {
        self.blocks += 1;
        for (j, joint) in block.joints.iter().enumerate() {
            self.own[j].add(&joint.own, 1.0);
            self.payload[j].add(&joint.payload);
            self.novel[j] += usize::from(joint.novel);
        }
    }

    /// Writes the score of each change at each joint into `joints`. Returns the score of a payload, in units of the
    /// joints' `noise` \[effort unit²\]; a joint of unknown noise does not contribute to it.
    pub fn scores(
        &self,
        references: &[Reference],
        noise: &[Option<f64>],
        joints: &mut [Option<JointScore>],
    ) -> OuterScore<PAYLOAD> {
        let mut payload = OuterScore::zero();
        for (j, score) in joints.iter_mut().enumerate() {
            *score = None;
            if let Some(compared) = Compared::new(&self.own[j], &references[j]) {
                *score = Some(compared.joint());
                if let Some(noise) = noise[j] {
                    payload.add(&compared.outer(&self.payload[j]), 1.0 / noise);
                }
            }
        }
        payload
    }
}
