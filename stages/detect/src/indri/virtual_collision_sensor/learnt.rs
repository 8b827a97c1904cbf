//! Learnt state of the adaptive sensor, kept between runs.

use std::collections::BTreeMap;

use crate::frame::joints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Learnt state of the adaptive sensor for a robot and its cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Learnt {
    /// Learnt state by joint name.
    pub joints: BTreeMap<String, LearntJoint>,
}

impl Learnt {
    /// Returns the reason why the state does not fit a robot with these joints, as a clause.
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

/// Learnt state of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LearntJoint {
    /// The bias that would have avoided every virtual collision so far (`Coll_Ident`) \[effort unit\].
    pub ident: f64,
    /// The bias from which the current adaptation started (`Coll_0`) \[effort unit\].
    pub start: f64,
    /// Time since the start of the current adaptation \[s\]; absent if learning has not been requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adapt_s: Option<f64>,
}

impl LearntJoint {
    /// Returns whether all values are finite and not negative.
    fn is_sound(&self) -> bool {
        [self.ident, self.start, self.adapt_s.unwrap_or(0.0)]
            .iter()
            .all(|x| x.is_finite() && *x >= 0.0)
    }
}
