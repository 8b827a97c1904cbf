//! The learnt state of a watch, which its file keeps between runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::blocks::Told;
use super::moments::{JOINT_KINDS, Moments};
use super::scale::{Loudness, Scale};

/// Learnt state of a watch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// State by joint, in URDF order.
    pub(crate) joints: Vec<OfJoint>,
    /// Baseline gain of a payload.
    pub(crate) payload: Scale,
}

/// Learnt state of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OfJoint {
    /// Reference, as sums of products.
    pub moments: Vec<f64>,
    /// Ranges of its motion in the current and the previous generation, and number of blocks in the current one.
    pub known: ([Told; 2], usize),
    /// Baseline gain of each kind of change.
    pub scales: [Scale; JOINT_KINDS],
    /// Energy of its blocks.
    pub loudness: Loudness,
}

impl Memory {
    /// Returns whether the state is complete and belongs to an arm with `joints` joints.
    pub fn fits(&self, joints: usize) -> bool {
        let whole = |joint: &OfJoint| Moments::of_numbers(&joint.moments).is_some();
        self.joints.len() == joints && self.joints.iter().all(whole)
    }
}
