//! The watching stage's part of the pipeline file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Watches a twin's residual and says when it changes character: which physics changed, where, since when.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Motion from which it learns how the twin is off as a rule, before it judges \[s\]. Standstill
    /// does not count.
    #[schemars(range(min = 10.0, max = 600.0))]
    pub learn_s: f64,
    /// How much larger than usual a deviation must be before it is told: 1 is made for less than one
    /// false word in many hours; more says less.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub caution: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            learn_s: 20.0,
            caution: 1.0,
        }
    }
}
