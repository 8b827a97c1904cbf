//! `SCENARIO.yaml`: the description of a simulated cell and its recordings.

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

/// A simulated cell and its recordings. The result is deterministic: the same file gives the same bytes.
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
    /// Seed of all random numbers; each recording draws its own, by its position in the list.
    #[serde(default)]
    pub seed: u64,
    /// Stamp of the first sample of the first recording \[s since the epoch\].
    #[serde(default = "default_start_s")]
    #[schemars(range(min = 1, max = 2_000_000_000))]
    pub start_s: u32,
    /// Rate of the joint states \[Hz\].
    #[serde(default = "default_rate_hz")]
    #[schemars(range(min = 1.0, max = 1000.0))]
    pub rate_hz: f64,
    /// Unit of the recorded effort: `Nm`, or `A` through the torque constants.
    #[serde(default)]
    pub effort_unit: EffortUnit,
    /// Torque constants by joint, joint side of the gear \[N m/A\]; each joint needs one if the unit is `A`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub torque_constants_nm_per_a: BTreeMap<String, f64>,
    /// An attached tool, known to the controller.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<ToolSpec>,
    /// Effects of the real arm that are missing in the URDF.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub physics: Vec<TermSpec>,
    /// Further effects, drawn at random and concealed, to be found by an identification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conceal: Option<ConcealSpec>,
    /// Sensors of the arm.
    #[serde(default)]
    pub sensors: Sensors,
    /// Controller of the arm.
    #[serde(default)]
    pub controller: ControllerSettings,
    /// The recordings, ordered by their stamps; together they are one session.
    #[schemars(length(min = 1))]
    pub recordings: Vec<RecordingSpec>,
}

impl Scenario {
    /// Returns the names of its recordings, for an error.
    pub(super) fn recording_names(&self) -> String {
        let names: Vec<&str> = self
            .recordings
            .iter()
            .map(|each| each.name.as_str())
            .collect();
        names.join(", ")
    }

    /// Returns all paths in it, so that the program can resolve them against the scenario file.
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
    /// The link it is attached to, which is also the frame of its parameters.
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

/// Sensors of the arm. They are exact, except for the errors given here.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Sensors {
    /// Whether a velocity is published.
    pub velocity: bool,
    /// White noise on positions, standard deviation \[rad\].
    #[schemars(range(min = 0.0))]
    pub position_noise_rad: f64,
    /// Quantisation step of the encoder; 0 for none \[rad\].
    #[schemars(range(min = 0.0))]
    pub position_step_rad: f64,
    /// White noise on velocities, standard deviation \[rad/s\].
    #[schemars(range(min = 0.0))]
    pub velocity_noise_rad_s: f64,
    /// Quantisation step of the velocity; 0 for none \[rad/s\].
    #[schemars(range(min = 0.0))]
    pub velocity_step_rad_s: f64,
    /// White noise on efforts, standard deviation \[N m\].
    #[schemars(range(min = 0.0))]
    pub effort_noise_nm: f64,
    /// Further white noise on efforts, standard deviation as a fraction of the joint's effort limit.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub effort_noise_of_limit: f64,
    /// Quantisation step of the effort; 0 for none \[N m\].
    #[schemars(range(min = 0.0))]
    pub effort_step_nm: f64,
    /// Gain of the torque sensor, by joint; by default 1.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub effort_gain: BTreeMap<String, f64>,
    /// Offset of the torque sensor, by joint; by default 0 \[N m\].
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
    /// Name of the recording; its file is `<name>.mcap`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_.-]*$"))]
    pub name: String,
    /// Purpose of the recording.
    #[serde(default)]
    pub role: Role,
    /// Duration \[s\].
    #[schemars(range(min = 0.01, max = 1_000_000.0))]
    pub duration_s: f64,
    /// Motion of the arm.
    pub motion: MotionSpec,
    /// Times at which the detectors are asked to relearn the arm's baseline behaviour, by a
    /// `std_msgs/msg/Bool` on `/learn` \[s from the start of the recording\].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub learn_at_s: Vec<f64>,
    /// Pushes at chosen times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactSpec>,
    /// Obstacles in the way of the arm.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleSpec>,
    /// Pushes at random times.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hands: Option<HandsSpec>,
}

/// Purpose of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Training.
    #[default]
    Train,
    /// Choice of thresholds.
    Validation,
    /// Evaluation.
    Test,
}
