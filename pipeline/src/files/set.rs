//! `SET.yaml`: labelled recordings for the evaluation of detectors.

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
    /// The robot's URDF; may be left out if the twin is a topic.
    #[serde(default)]
    pub robot: Option<PathBuf>,
    /// File of labels; by default `labels.json` or `labels_train.json` next to this file, or the contact topic.
    #[serde(default)]
    pub labels: Option<PathBuf>,
    /// Nominal rate of the recordings \[Hz\], for information only: the stamps give the time.
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
    /// Contact point on the tool \[m, in the tool link's frame\].
    #[serde(default)]
    pub contact_point_on_tool_m: Option<[f64; 3]>,
    /// Topics of the recordings.
    #[serde(default)]
    pub topics: SetTopics,
    /// Impedance of the Cartesian controller during the recordings.
    #[serde(default)]
    pub impedance: Option<Impedance>,
    /// Length of one cycle of a cyclic motion \[s\].
    #[serde(default)]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub cycle_s: Option<f64>,
    /// Number of cycles in the train recordings, for information only: detectors learn from all of these recordings.
    #[serde(default)]
    #[schemars(range(min = 1))]
    pub learning_cycles: Option<u32>,
    /// Contact-free time at the beginning of each recording, from which `tauscope` takes its offset \[s\].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub free_first_s: f64,
    /// Recovery time after a contact in which an alarm is not counted as false, such as the duration of a protective
    /// stop \[s\].
    #[serde(default = "recovery_s")]
    #[schemars(range(min = 0.0))]
    pub recovery_s: f64,
    /// Settings of detectors by name, as under a pipeline's `detect`. `threshold` and `hold_s` apply to all of them.
    #[serde(default)]
    pub detectors: tauscope_detect::Config,
    /// Contact-free recordings for training.
    #[serde(default)]
    pub train: Vec<PathBuf>,
    /// Recordings for choosing thresholds.
    #[serde(default)]
    pub validation: Vec<PathBuf>,
    /// Recordings to be scored.
    #[serde(default)]
    pub test: Vec<PathBuf>,
}

/// Default recovery time, because filters delay the end of a contact \[s\].
fn recovery_s() -> f64 {
    0.15
}

/// Topics of a set's recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SetTopics {
    /// Measured joint states.
    pub state: String,
    /// Commanded positions.
    pub command: Option<String>,
    /// Efforts of an external twin.
    pub twin: Option<String>,
    /// Contact flag (`std_msgs/msg/Bool`).
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
    /// Damping rule in words, e.g. `2 sqrt(K)`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<String>,
}
