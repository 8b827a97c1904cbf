//! What the adaptive sensor has learnt, to be kept from one run to the next.

use std::collections::BTreeMap;

use crate::frame::joints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What the adaptive sensor has learnt of a robot and its cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Learnt {
    /// By the joint's name.
    pub joints: BTreeMap<String, LearntJoint>,
}

impl Learnt {
    /// What is wrong with it for a robot with these joints, as a clause.
    pub(super) fn fault(&self, joint_names: &[String]) -> Option<String> {
        let unsound = || {
            let mut joints = self.joints.iter();
            let (name, _) = joints.find(|(_, joint)| !joint.is_sound())?;
            let what = "holds a number that is negative or not finite";
            Some(format!("of the joint {name} {what}"))
        };
        joints::others(self.joints.keys(), joint_names).or_else(unsound)
    }
}

/// What it has learnt of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntJoint {
    /// The bias that would have avoided every virtual collision so far (`Coll_Ident`) \[effort unit\].
    pub ident: f64,
    /// The bias from which the adaptation began last (`Coll_0`) \[effort unit\].
    pub start: f64,
    /// How long it has been adapting since \[s\]; absent where nobody has asked for learning yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adapt_s: Option<f64>,
}

impl LearntJoint {
    /// Whether the numbers can be what somebody learnt.
    fn is_sound(&self) -> bool {
        [self.ident, self.start, self.adapt_s.unwrap_or(0.0)]
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    }
}
