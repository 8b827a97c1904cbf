//! The twin's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A twin: what the effort should have been.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The corrected twin that `tauscope calibrate` or `tauscope explain` wrote (`twin.yaml`). Without
    /// it the twin is the rigid-body model as the URDF has it.
    pub model: Option<PathBuf>,
    /// The motion whose effort is computed.
    pub motion: Motion,
    /// Where the expected effort comes from.
    pub expected: Expected,
    /// Low-pass on the velocity before it is differentiated to the acceleration \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub velocity_cutoff_hz: f64,
    /// The same low-pass on measured and expected effort \[Hz\]; the residual is their difference.
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub effort_cutoff_hz: f64,
    /// A gap between two samples longer than this starts the filters anew \[s\].
    #[schemars(range(min = 0.001, max = 3600.0))]
    pub max_gap_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            model: None,
            motion: Motion::Measured,
            expected: Expected::Model,
            velocity_cutoff_hz: 12.0,
            effort_cutoff_hz: 4.5,
            max_gap_s: 0.25,
        }
    }
}

/// The motion whose effort the twin computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// The measured positions and velocities.
    #[default]
    Measured,
    /// The measured velocities, integrated from the first position, as a simulator driven by them
    /// would move (Tajiri and Iwamoto, section III-C).
    VelocityHistory,
    /// The commanded motion (Indri, Trapani and Lazzero, equation 2).
    Commanded,
}

/// Where the expected effort comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Expected {
    /// From the robot's rigid-body model.
    #[default]
    Model,
    /// From somebody else's twin, whose effort the source reads from a topic.
    Topic,
}
