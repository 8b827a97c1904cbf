//! The initial bias (`Coll_bias0`) in the pipeline file.

use std::collections::BTreeMap;

use crate::frame::{ConfigError, joints};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The smallest effort treated as a collision before learning, by joint \[effort unit\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FirstBias {
    /// By joint name.
    ByName(BTreeMap<String, f64>),
    /// In URDF order.
    InOrder(Vec<f64>),
}

impl FirstBias {
    /// Maps the values, in the order of `joint_names`, to the names.
    pub(super) fn named(joint_names: &[String], values: impl Iterator<Item = f64>) -> Self {
        Self::ByName(joint_names.iter().cloned().zip(values).collect())
    }

    /// Returns one value per joint, in the order of `joint_names`.
    ///
    /// # Errors
    /// If the joints differ, or a value is negative or not finite.
    pub(crate) fn resolve(
        &self,
        detector: &'static str,
        joint_names: &[String],
    ) -> Result<Vec<f64>, ConfigError> {
        let wrong = |reason| ConfigError::Bias { detector, reason };
        let values = match self {
            Self::ByName(values) => {
                let of_others = joints::others(values.keys(), joint_names);
                if let Some(reason) = of_others {
                    return Err(wrong(reason));
                }
                joint_names.iter().map(|name| values[name]).collect()
            }
            Self::InOrder(values) => values.clone(),
        };
        let joint_count = joint_names.len();
        if values.len() != joint_count {
            let found = values.len();
            return Err(wrong(format!(
                "has {found} numbers, the robot has {joint_count} joints"
            )));
        }
        if values
            .iter()
            .any(|bias| !(bias.is_finite() && *bias >= 0.0))
        {
            return Err(wrong(
                "holds a number that is negative or not finite".to_owned(),
            ));
        }
        Ok(values)
    }
}
