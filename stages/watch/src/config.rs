//! The stage's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Watches a twin's residual and reports its changes: which effect changed, where, and since when.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Duration of motion from which the stage learns the baseline of the residual before it reports changes \[s\].
    /// Standstill is excluded.
    #[schemars(range(min = 10.0, max = 600.0))]
    pub learn_s: f64,
    /// Factor on the thresholds above which deviations are reported. The default of 1 aims at less than one
    /// false report in many hours; larger values report less.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub caution: f64,
    /// State file that keeps the learnt baseline between runs. A run starts from its contents, and writes it when
    /// learning ends, every 10 s and when the run ends. A replay neither reads nor writes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<PathBuf>,
}

/// Default of [`Config::learn_s`].
/// Chosen: two and a half long windows of the baseline; less raises all thresholds, more only delays the first
/// report.
const LEARN_S: f64 = 20.0;
/// Default of [`Config::caution`]: unscaled thresholds.
/// Derived: 1 leaves the thresholds as they are.
const CAUTION: f64 = 1.0;

impl Default for Config {
    fn default() -> Self {
        Self {
            learn_s: LEARN_S,
            caution: CAUTION,
            state: None,
        }
    }
}
