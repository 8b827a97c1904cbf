//! `SCENARIO.yaml`: what a simulated cell is and does.

use std::collections::BTreeMap;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_dynamics::terms::TermSpec;

use super::conceal::ConcealSpec;

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

/// Unit of an effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum EffortUnit {
    /// N m (N for a prismatic joint).
    #[default]
    Nm,
    /// A: motor current.
    A,
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

/// How the arm is driven: PD, an integral part, and the effort of the nominal model ahead.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerSettings {
    /// Natural frequency of the position loop \[Hz\].
    #[schemars(range(min = 0.1, max = 50.0))]
    pub natural_hz: f64,
    /// Its damping ratio.
    #[schemars(range(min = 0.1, max = 5.0))]
    pub damping: f64,
    /// Time in which the integral part takes over a lasting error; 0 for no integral part \[s\].
    #[schemars(range(min = 0.0, max = 100.0))]
    pub integral_time_s: f64,
}

impl Default for ControllerSettings {
    fn default() -> Self {
        Self {
            natural_hz: 5.0,
            damping: 1.0,
            integral_time_s: 0.5,
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
    /// Pushes at chosen times.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contacts: Vec<ContactSpec>,
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

/// How the arm moves: exactly one of the three.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// From point to point, with rests.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsSpec>,
    /// Periodic excitation of all joints at once, as for identification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fourier: Option<FourierSpec>,
    /// The motion of a recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded: Option<RecordedMotionSpec>,
}

/// Motion from point to point along quintic polynomials, all joints at once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PointsSpec {
    /// The points, visited in this order again and again \[rad\]. Without them each point is drawn at random.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through: Vec<Vec<f64>>,
    /// Highest velocity, as a share of each joint's limit.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub speed: f64,
    /// Highest acceleration \[rad/s²\].
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub acceleration_rad_s2: f64,
    /// Shortest and longest rest at a point \[s\].
    pub rest_s: [f64; 2],
    /// Random points lie within this share of each joint's range, about its middle.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range: f64,
    /// Random points keep every moving link's frame this high above the base \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_height_m: Option<f64>,
}

impl Default for PointsSpec {
    fn default() -> Self {
        Self {
            through: Vec::new(),
            speed: 0.4,
            acceleration_rad_s2: 3.0,
            rest_s: [0.2, 0.6],
            range: 0.6,
            min_height_m: None,
        }
    }
}

/// A sum of sines with random coefficients, the same for each period. It begins and ends at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FourierSpec {
    /// The period \[s\].
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub period_s: f64,
    /// How many harmonics of it.
    #[schemars(range(min = 1, max = 50))]
    pub harmonics: u32,
    /// Highest velocity, as a share of each joint's limit.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub speed: f64,
    /// Highest acceleration \[rad/s²\].
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub acceleration_rad_s2: f64,
    /// Share of each joint's range that it keeps within.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range: f64,
    /// The position it swings about \[rad\]; by default the middle of each joint's range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub about: Option<Vec<f64>>,
}

impl Default for FourierSpec {
    fn default() -> Self {
        Self {
            period_s: 10.0,
            harmonics: 5,
            speed: 0.5,
            acceleration_rad_s2: 4.0,
            range: 0.6,
            about: None,
        }
    }
}

/// The positions of a recording, joined by cubic splines.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotionSpec {
    /// The recording; relative to this file.
    pub path: PathBuf,
    /// Its topic (`sensor_msgs/msg/JointState`).
    #[serde(default = "default_motion_topic")]
    pub topic: String,
}

fn default_motion_topic() -> String {
    "/joint_states".to_owned()
}

/// A push at a chosen time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactSpec {
    /// The link that is touched.
    pub link: String,
    /// Where, in the link's frame \[m\]; by default at its centre of mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_m: Option<[f64; 3]>,
    /// Force on the robot at its peak, world frame \[N\].
    pub force_n: [f64; 3],
    /// When it begins \[s from the start of the recording\].
    #[schemars(range(min = 0.0))]
    pub t_on_s: f64,
    /// When it has ended \[s from the start of the recording\].
    pub t_off_s: f64,
    /// How long the force takes to rise, and to fall \[s\].
    #[serde(default = "default_rise_s")]
    #[schemars(range(min = 0.001))]
    pub rise_s: f64,
    /// What it is called in the labels.
    #[serde(default = "default_kind")]
    pub kind: String,
}

pub(super) fn default_rise_s() -> f64 {
    0.08
}

pub(super) fn default_kind() -> String {
    "contact".to_owned()
}

/// Pushes by a hand: one in each of `count` equal parts of the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandsSpec {
    /// How many.
    #[schemars(range(max = 100_000))]
    pub count: u32,
    /// Weakest and strongest force \[N\].
    #[serde(default = "default_force_n")]
    pub force_n: [f64; 2],
    /// Shortest and longest \[s\].
    #[serde(default = "default_hand_duration_s")]
    pub duration_s: [f64; 2],
    /// Links that are touched; by default all that move.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<String>,
    /// None earlier than this \[s from the start of the recording\].
    #[serde(default = "default_after_s")]
    pub after_s: f64,
}

fn default_force_n() -> [f64; 2] {
    [10.0, 30.0]
}

fn default_hand_duration_s() -> [f64; 2] {
    [0.4, 1.2]
}

fn default_after_s() -> f64 {
    2.0
}
