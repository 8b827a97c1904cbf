//! `SET.yaml`: labelled recordings that detectors are evaluated on.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cell::EffortUnit;

/// A robot and labelled recordings of it. Paths are relative to the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "tauscope set")]
pub struct SetFile {
    /// Name of the set.
    pub set: String,
    /// The robot's URDF; may be left out where the twin is a topic.
    #[serde(default)]
    pub robot: Option<PathBuf>,
    /// The labels; without them `labels.json` or `labels_train.json` beside the file, or the contact
    /// topic.
    #[serde(default)]
    pub labels: Option<PathBuf>,
    /// Nominal rate of the recordings \[Hz\], for information: time is in the stamps.
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rate_hz: Option<f64>,
    /// Unit of the measured effort.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constant by joint \[N m/A\], for efforts in A.
    #[serde(default)]
    pub torque_constants_nm_per_a: Option<BTreeMap<String, f64>>,
    /// The link that carries the tool.
    #[serde(default)]
    pub tool_link: Option<String>,
    /// Where on the tool it is touched \[m, in the tool link's frame\].
    #[serde(default)]
    pub contact_point_on_tool_m: Option<[f64; 3]>,
    /// Where in the recordings the messages are.
    #[serde(default)]
    pub topics: SetTopics,
    /// The impedance that a Cartesian controller held.
    #[serde(default)]
    pub impedance: Option<Impedance>,
    /// Length of one cycle of a cyclic motion \[s\].
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cycle_s: Option<f64>,
    /// How many cycles the train recordings hold, for information: detectors learn from all of these recordings.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub learning_cycles: Option<u32>,
    /// For so long nothing touches the robot at the beginning of each recording \[s\]: there `tauscope` takes its offset from.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub free_first_s: f64,
    /// Settings of detectors by name, as a pipeline's `detect` has them. `threshold` and `hold_s` beside them are for all.
    #[serde(default)]
    pub detectors: tauscope_detect::Config,
    /// Contact-free recordings that detectors are trained on.
    #[serde(default)]
    pub train: Vec<PathBuf>,
    /// Recordings that thresholds are chosen on.
    #[serde(default)]
    pub validation: Vec<PathBuf>,
    /// Recordings that are scored.
    #[serde(default)]
    pub test: Vec<PathBuf>,
}

/// Topics of a set's recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SetTopics {
    /// Measured joint states.
    pub state: String,
    /// Commanded positions.
    pub command: Option<String>,
    /// Efforts that another twin computed.
    pub twin: Option<String>,
    /// Whether something touches the robot (`std_msgs/msg/Bool`).
    pub contact: Option<String>,
}

impl Default for SetTopics {
    fn default() -> Self {
        Self {
            state: "/joint_states".to_owned(),
            command: None,
            twin: None,
            contact: None,
        }
    }
}

/// A Cartesian impedance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Impedance {
    /// Translational stiffness \[N/m\].
    #[schemars(range(min = 0.0))]
    pub translational_n_per_m: f64,
    /// Rotational stiffness \[N m/rad\].
    #[schemars(range(min = 0.0))]
    pub rotational_nm_per_rad: f64,
    /// The damping's rule in words, e.g. `2 sqrt(K)`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<String>,
}
