//! `SCENARIO.yaml`: what a simulated cell is and does.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use tauscope_bus::EffortUnit;
use tauscope_dynamics::terms::TermSpec;

use super::conceal::ConcealSpec;

mod contacts;
mod controller;
mod motion;

pub use contacts::{
    BoxSpec, ContactKind, ContactSpec, HandsSpec, LabelSpec, ObstacleSpec, PlaneSpec, Profile,
    SphereSpec,
};
pub use controller::{ControllerSettings, Damps, ImpedanceSpec};
pub use motion::{FourierSpec, MotionSpec, PointsSpec, ReachSpec, RecordedMotionSpec, WithinSpec};

/// A simulated cell and the recordings it makes. The same file makes the same bytes every time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Version of this format: 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Name of the set of recordings, for the labels.
    #[serde(default = "default_name")]
    pub name: String,
    /// The robot's URDF; relative to this file.
    pub robot: PathBuf,
    /// Everything random follows from this number and the recording's place in the list.
    #[serde(default)]
    pub seed: u64,
    /// Stamp of the first sample of the first recording \[s since the epoch\].
    #[serde(default = "default_start_s")]
    #[schemars(range(min = 1, max = 2_000_000_000))]
    pub start_s: u32,
    /// Joint states a second.
    #[serde(default = "default_rate_hz")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub rate_hz: f64,
    /// Unit of the recorded effort: `Nm`, or `A` by the torque constants.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constants by joint, joint side of the gear \[N m/A\]; each joint needs one if the unit is `A`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub torque_constants_nm_per_a: BTreeMap<String, f64>,
    /// A tool that is attached, and that the controller knows of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<ToolSpec>,
    /// What the real arm has and the URDF does not say.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<TermSpec>,
    /// More of that, drawn at random: for somebody to find.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conceal: Option<ConcealSpec>,
    /// How it is measured.
    #[serde(default)]
    pub sensors: Sensors,
    /// How it is driven.
    #[serde(default)]
    pub controller: ControllerSettings,
    /// The recordings, in the order of their stamps: together they are one session.
    #[schemars(length(min = 1))]
    pub recordings: Vec<RecordingSpec>,
}

impl Scenario {
    /// The names of its recordings, for an error.
    pub(super) fn recording_names(&self) -> String {
        let names: Vec<&str> = self
            .recordings
            .iter()
            .map(|each| each.name.as_str())
            .collect();
        names.join(", ")
    }

    /// Every path in it, so that the program can resolve them against the scenario file.
    pub fn paths_mut(&mut self) -> impl Iterator<Item = &mut PathBuf> {
        let motions = self.recordings.iter_mut().map(|each| &mut each.motion);
        let recorded = motions.filter_map(|motion| motion.recorded.as_mut());
        std::iter::once(&mut self.robot).chain(recorded.map(|recorded| &mut recorded.path))
    }
}

fn default_name() -> String {
    "simulated".to_owned()
}

fn default_start_s() -> u32 {
    1_767_225_600
}

fn default_rate_hz() -> f64 {
    100.0
}

/// A tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ToolSpec {
    /// The link it is attached to, in whose frame it is described.
    pub link: String,
    /// Mass \[kg\].
    #[schemars(range(min = 0.0))]
    pub mass_kg: f64,
    /// Centre of mass \[m\].
    #[serde(default)]
    pub com_m: [f64; 3],
    /// Inertia about the centre of mass: xx, xy, xz, yy, yz, zz \[kg m²\].
    #[serde(default)]
    pub inertia_kgm2: [f64; 6],
}

/// How the arm is measured. What is not given is exact.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sensors {
    /// Whether a velocity is published.
    pub velocity: bool,
    /// White noise on positions, standard deviation \[rad\].
    #[schemars(range(min = 0.0))]
    pub position_noise_rad: f64,
    /// Step of the encoder; 0 for none \[rad\].
    #[schemars(range(min = 0.0))]
    pub position_step_rad: f64,
    /// White noise on velocities, standard deviation \[rad/s\].
    #[schemars(range(min = 0.0))]
    pub velocity_noise_rad_s: f64,
    /// Step of the velocity; 0 for none \[rad/s\].
    #[schemars(range(min = 0.0))]
    pub velocity_step_rad_s: f64,
    /// White noise on efforts, standard deviation \[N m\].
    #[schemars(range(min = 0.0))]
    pub effort_noise_nm: f64,
    /// White noise on efforts as a share of the joint's effort limit, standard deviation; adds to the other.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub effort_noise_of_limit: f64,
    /// Step of the effort; 0 for none \[N m\].
    #[schemars(range(min = 0.0))]
    pub effort_step_nm: f64,
    /// By joint, what the torque sensor multiplies the effort by.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub effort_gain: BTreeMap<String, f64>,
    /// By joint, what the torque sensor adds to the effort \[N m\].
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub effort_bias_nm: BTreeMap<String, f64>,
}

impl Default for Sensors {
    fn default() -> Self {
        Self {
            velocity: true,
            position_noise_rad: 0.0,
            position_step_rad: 0.0,
            velocity_noise_rad_s: 0.0,
            velocity_step_rad_s: 0.0,
            effort_noise_nm: 0.0,
            effort_noise_of_limit: 0.0,
            effort_step_nm: 0.0,
            effort_gain: BTreeMap::new(),
            effort_bias_nm: BTreeMap::new(),
        }
    }
}

/// One recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordingSpec {
    /// Its name: the file is `<name>.mcap`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"))]
    pub name: String,
    /// What it is for.
    #[serde(default)]
    pub role: Role,
    /// How long it lasts \[s\].
    #[schemars(range(min = 0.01, max = 1_000_000.0))]
    pub duration_s: f64,
    /// How the arm moves.
    pub motion: MotionSpec,
    /// When somebody asks the detectors to learn the arm's usual behaviour anew \[s\]: `std_msgs/msg/Bool` on
    /// `/learn`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learn_at_s: Vec<f64>,
    /// Pushes at chosen times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactSpec>,
    /// What stands in the way.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleSpec>,
    /// Pushes at random times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hands: Option<HandsSpec>,
}

/// What a recording is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// To learn from.
    #[default]
    Train,
    /// To choose thresholds on.
    Validation,
    /// To be judged on.
    Test,
}
