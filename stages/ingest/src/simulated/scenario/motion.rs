//! Motion of the arm in a scenario.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::CsvMapping;

/// Motion of the arm: exactly one of the three.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MotionSpec {
    /// Motion from point to point, with rests.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsSpec>,
    /// Periodic excitation of all joints at once, as for identification.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fourier: Option<FourierSpec>,
    /// The motion of a recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded: Option<RecordedMotionSpec>,
}

/// Motion from point to point along quintic polynomials, all joints at once. At most one of `through`,
/// `through_m` and `within` selects the points; without them each is drawn at random from the joints' ranges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PointsSpec {
    /// The points, visited in this order, repeatedly \[rad\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through: Vec<Vec<f64>>,
    /// The points as places of a link, world frame \[m\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through_m: Vec<[f64; 3]>,
    /// Points drawn at random from within a radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within: Option<WithinSpec>,
    /// Link and orientation with which the points of `through_m` and `within` are reached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach: Option<ReachSpec>,
    /// Number of cycles through a list of points, back to the first, where the arm then stays. By default the
    /// cycle repeats to the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub cycles: Option<u32>,
    /// Highest velocity, as a fraction of each joint's limit.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub speed: f64,
    /// Highest acceleration \[rad/s²\].
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub acceleration_rad_s2: f64,
    /// Shortest and longest rest at a point \[s\].
    pub rest_s: [f64; 2],
    /// Fraction of each joint's range, about its middle, from which random points are drawn.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range: f64,
    /// Minimum height of every moving link's frame above the base at random points \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_height_m: Option<f64>,
}

impl Default for PointsSpec {
    fn default() -> Self {
        Self {
            through: Vec::new(),
            through_m: Vec::new(),
            within: None,
            reach: None,
            cycles: None,
            speed: 0.4,
            acceleration_rad_s2: 3.0,
            rest_s: [0.2, 0.6],
            range: 0.6,
            min_height_m: None,
        }
    }
}

/// Random points: places uniformly distributed in a sphere. The path between two of them is straight in the
/// joints' positions, not for the link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WithinSpec {
    /// Radius of the sphere \[m\].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius_m: f64,
    /// Centre of the sphere, world frame \[m\]; by default the place of the link in the posture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about_m: Option<[f64; 3]>,
    /// Largest rotation of the link from the posture's orientation, about a random axis \[rad\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3.1))]
    pub turn_rad: f64,
    /// Number of points to draw and to visit repeatedly; by default every point is a new one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000))]
    pub count: Option<u32>,
}

/// Link and orientation with which places are reached.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReachSpec {
    /// The link; by default the one that holds tools.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The point of the link that reaches the place, in its frame \[m\].
    pub point_m: [f64; 3],
    /// Joint positions from which the inverse kinematics starts, and which define the link's orientation \[rad\];
    /// by default the middle of each joint's range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub posture: Option<Vec<f64>>,
    /// Whether the link's orientation is free; required for an arm with fewer than six joints.
    pub any_orientation: bool,
}

/// A sum of sines with random coefficients, identical in each period. It begins and ends at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FourierSpec {
    /// The period \[s\].
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub period_s: f64,
    /// Number of harmonics of the period.
    #[schemars(range(min = 1, max = 50))]
    pub harmonics: u32,
    /// Highest velocity, as a fraction of each joint's limit.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub speed: f64,
    /// Highest acceleration \[rad/s²\].
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub acceleration_rad_s2: f64,
    /// Fraction of each joint's range that the motion uses.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range: f64,
    /// Centre of the motion \[rad\]; by default the middle of each joint's range.
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

/// The positions of a recording or of a table, joined by cubic splines.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotionSpec {
    /// The recording or table; relative to this file.
    pub path: PathBuf,
    /// Its topic (`sensor_msgs/msg/JointState`).
    #[serde(default = "default_motion_topic")]
    pub topic: String,
    /// Mapping of the columns of a CSV table to quantities; only times and positions are used.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<CsvMapping>,
}

fn default_motion_topic() -> String {
    "/joint_states".to_owned()
}
