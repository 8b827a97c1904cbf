//! What a watch has learnt, as its file holds it between two runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::blocks::Told;
use super::moments::{JOINT_KINDS, Moments};
use super::scale::{Loudness, Scale};

/// What a watch has learnt of an arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// By joint in URDF order.
    pub(crate) joints: Vec<OfJoint>,
    /// The usual gain of a payload.
    pub(crate) payload: Scale,
}

/// What it has learnt of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OfJoint {
    /// The reference: sums of products.
    pub moments: Vec<f64>,
    /// The ranges in which it moved.
    pub known: ([Told; 2], usize),
    /// The usual gain of each kind of change.
    pub scales: [Scale; JOINT_KINDS],
    /// The energy of its blocks.
    pub loudness: Loudness,
}

impl Memory {
    /// Whether it is of an arm with so many joints, and whole.
    pub fn fits(&self, joints: usize) -> bool {
        let whole = |joint: &OfJoint| Moments::of_numbers(&joint.moments).is_some();
        self.joints.len() == joints && self.joints.iter().all(whole)
    }
}
