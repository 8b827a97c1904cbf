//! Contacts and obstacles in a scenario.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A push at a chosen time. Pushes may overlap with each other and with obstacles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ContactSpec {
    /// The link that is touched.
    pub link: String,
    /// Point of application in the link's frame \[m\]; by default its centre of mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_m: Option<[f64; 3]>,
    /// Force on the robot at its peak, world frame \[N\].
    pub force_n: [f64; 3],
    /// Begin \[s from the start of the recording\].
    #[schemars(range(min = 0.0))]
    pub t_on_s: f64,
    /// End \[s from the start of the recording\].
    pub t_off_s: f64,
    /// Rise time and fall time of the force; at most half of the time from begin to end \[s\].
    #[serde(default = "default_rise_s")]
    #[schemars(range(min = 0.001))]
    pub rise_s: f64,
    /// Profile of the force over time.
    #[serde(default, skip_serializing_if = "is_default")]
    pub profile: Profile,
    /// Kind of contact in the labels.
    #[serde(default)]
    pub kind: ContactKind,
    /// Further labels.
    #[serde(default, skip_serializing_if = "is_default")]
    pub label: LabelSpec,
}

fn default_rise_s() -> f64 {
    0.08
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Kinds of contact in the labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContactKind {
    /// A contact of neither kind below.
    #[default]
    Contact,
    /// An accident: short and hard.
    Collision,
    /// Hand guiding: the force rises slowly.
    Cooperation,
}

/// Profiles of the force of a push over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Profile {
    /// Half-cosine flanks of length `rise_s`, and the full force in between.
    #[default]
    Smooth,
    /// Linear flanks of length `rise_s`, and the full force in between.
    Trapezoid,
    /// A half sine from begin to end; `rise_s` is not used.
    HalfSine,
}

/// Labels of a contact in addition to its place, time and force.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LabelSpec {
    /// Person who cooperated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// Whether this person had done so before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub experienced: Option<bool>,
    /// Material that was hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Motion during the impact.
    #[serde(rename = "move", skip_serializing_if = "Option::is_none")]
    pub motion: Option<String>,
    /// Zone of the workspace in which it was hit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zone: Option<String>,
}

/// Pushes by a hand: one in each of `count` equal parts of the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HandsSpec {
    /// Number of pushes.
    #[schemars(range(max = 100_000))]
    pub count: u32,
    /// Weakest and strongest force \[N\].
    #[serde(default = "default_force_n")]
    pub force_n: [f64; 2],
    /// Shortest and longest duration \[s\].
    #[serde(default = "default_hand_duration_s")]
    pub duration_s: [f64; 2],
    /// Links that are touched; by default all that move.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<String>,
    /// Earliest begin of a push \[s from the start of the recording\].
    #[serde(default = "default_after_s")]
    pub after_s: f64,
    /// Rise time and fall time of each force \[s\].
    #[serde(default = "default_rise_s")]
    #[schemars(range(min = 0.001))]
    pub rise_s: f64,
    /// Profile of the forces over time.
    #[serde(default, skip_serializing_if = "is_default")]
    pub profile: Profile,
    /// Kind of contact in the labels.
    #[serde(default, skip_serializing_if = "is_default")]
    pub kind: ContactKind,
    /// Further labels.
    #[serde(default, skip_serializing_if = "is_default")]
    pub label: LabelSpec,
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

/// An obstacle: exactly one of `plane`, `box` and `sphere`, which a round tip on a link runs into. It pushes
/// along its normal, without friction, and never pulls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSpec {
    /// Everything behind a plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<PlaneSpec>,
    /// A box.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub cuboid: Option<BoxSpec>,
    /// A sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<SphereSpec>,
    /// Stiffness \[N/m\].
    #[serde(default = "default_stiffness")]
    #[schemars(range(min = 1.0, max = 1_000_000.0))]
    pub stiffness_n_per_m: f64,
    /// Damping \[N s/m\].
    #[serde(default = "default_damping")]
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub damping_ns_per_m: f64,
    /// The link that runs into it; by default the one that holds tools.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// Centre of the tip that touches it, in the link's frame \[m\].
    #[serde(default)]
    pub point_m: [f64; 3],
    /// Radius of the tip \[m\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub radius_m: f64,
    /// Time at which it appears \[s from the start of the recording\].
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub from_s: f64,
    /// Time at which it is removed; by default never \[s from the start of the recording\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Kind of its contacts in the labels.
    #[serde(default = "collision")]
    pub kind: ContactKind,
    /// Further labels of its contacts.
    #[serde(default, skip_serializing_if = "is_default")]
    pub label: LabelSpec,
}

fn default_stiffness() -> f64 {
    10_000.0
}

fn default_damping() -> f64 {
    50.0
}

fn collision() -> ContactKind {
    ContactKind::Collision
}

/// A plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaneSpec {
    /// A point of it, world frame \[m\].
    pub point_m: [f64; 3],
    /// Normal that points to the free side, of any length but 0, world frame.
    pub normal: [f64; 3],
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxSpec {
    /// Its centre, world frame \[m\].
    pub center_m: [f64; 3],
    /// Its edges \[m\].
    pub size_m: [f64; 3],
    /// Roll, pitch and yaw about the world's axes, as in a URDF \[rad\].
    #[serde(default)]
    pub rpy_rad: [f64; 3],
}

/// A sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereSpec {
    /// Its centre, world frame \[m\].
    pub center_m: [f64; 3],
    /// Its radius \[m\].
    pub radius_m: f64,
}
