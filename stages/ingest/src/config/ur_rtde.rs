//! Settings of a Universal Robots controller in the pipeline file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A Universal Robots controller over its Real-Time Data Exchange (RTDE). Only outputs are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UrRtdeConfig {
    /// Name or address of the controller.
    pub host: String,
    /// TCP port of RTDE.
    #[serde(default = "default_port")]
    pub port: u16,
    /// Packages per second \[Hz\]. The controller limits them: e-Series to 500, CB3 to 125.
    #[serde(default = "default_rate_hz")]
    #[schemars(range(min = 1.0, max = 500.0))]
    pub rate_hz: f64,
    /// The arm's joints from base to wrist, by their names in the URDF; by default the cell's six joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joints: Option<Vec<String>>,
    /// Output of the controller that is read as the measured effort.
    #[serde(default)]
    pub effort: UrEffort,
    /// Whether the controller's `target_moment` is read as an external twin's effort, for `twin: {expected: topic}`.
    #[serde(default)]
    pub target_moment: bool,
    /// Whether the payload set on the controller is used as the attached tool. Requires a `tool` of the cell whose
    /// `link` is the flange.
    #[serde(default)]
    pub payload: bool,
    /// Capacity of the queue of received packages. When it is full, the oldest package is dropped and counted.
    #[serde(default = "default_queue")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub queue: usize,
}

/// Outputs of the controller that can be read as the measured effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UrEffort {
    /// Motor current \[A\]: the cell has `effort_unit: A`.
    #[default]
    ActualCurrent,
    /// Torque from the motor current \[N m\]; newer controllers only.
    ActualCurrentAsTorque,
    /// Torque required by the controller's own model \[N m\]. It is not measured, so contacts do not show.
    TargetMoment,
}

impl UrEffort {
    /// Returns the name of the output in RTDE.
    pub(crate) fn field(self) -> &'static str {
        match self {
            Self::ActualCurrent => "actual_current",
            Self::ActualCurrentAsTorque => "actual_current_as_torque",
            Self::TargetMoment => "target_moment",
        }
    }
}

fn default_port() -> u16 {
    30004
}

fn default_rate_hz() -> f64 {
    500.0
}

fn default_queue() -> usize {
    1024
}

impl UrRtdeConfig {
    /// `host:port`.
    pub(crate) fn address(&self) -> String {
        format!("{}:{}", self.host, self.port)
    }
}
