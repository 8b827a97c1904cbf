//! `CASE.yaml`: a robot, a twin and recordings whose mismatch is to be explained.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cell::EffortUnit;

/// A robot and recordings of it. Paths are relative to the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(title = "tauscope case")]
pub struct CaseFile {
    /// Name of the case.
    pub case: String,
    /// The robot's URDF; also the twin, unless `twin` names another.
    #[serde(default)]
    pub robot: Option<PathBuf>,
    /// Another twin than the URDF.
    #[serde(default)]
    pub twin: Option<CaseTwin>,
    /// Unit of the measured effort.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constant by joint \[N m/A\], for efforts in A; left out if unknown.
    #[serde(default)]
    pub torque_constants_nm_per_a: Option<BTreeMap<String, f64>>,
    /// The joints and their order, if there is no URDF; without both, those of the first message.
    #[serde(default)]
    pub joint_names: Option<Vec<String>>,
    /// Nominal rate of the recordings \[Hz\], for information only: the stamps give the time.
    #[serde(default)]
    pub rate_hz: Option<f64>,
    /// Whether the recordings hold velocities, for information only.
    #[serde(default)]
    pub has_velocity: Option<bool>,
    /// Topics of the recordings.
    #[serde(default)]
    pub topics: CaseTopics,
    /// Recordings to fit on.
    #[schemars(length(min = 1))]
    pub fit: Vec<PathBuf>,
    /// Recordings held out from the fit, for validation; without them some of `fit` are held out.
    #[serde(default)]
    pub holdout: Vec<PathBuf>,
}

/// A twin other than the plain URDF: one of the two keys, or both for a corrected external twin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaseTwin {
    /// Topic of the efforts of an external twin.
    #[serde(default)]
    pub topic: Option<String>,
    /// A corrected twin to start from; findings are changes since then.
    #[serde(default)]
    pub model: Option<PathBuf>,
}

/// Topics of a case's recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CaseTopics {
    /// Measured joint states.
    pub state: String,
    /// Commanded positions.
    pub command: Option<String>,
}

impl Default for CaseTopics {
    fn default() -> Self {
        Self {
            state: "/joint_states".to_owned(),
            command: None,
        }
    }
}
