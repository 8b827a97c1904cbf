//! How the arm moves.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_archive::CsvMapping;

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

/// Motion from point to point along quintic polynomials, all joints at once. At most one of `through`,
/// `through_m` and `within` says which points; without them each is drawn at random from the joints' ranges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PointsSpec {
    /// The points, visited in this order again and again \[rad\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through: Vec<Vec<f64>>,
    /// The same as places of a link, world frame \[m\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub through_m: Vec<[f64; 3]>,
    /// Points drawn at random from within a radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub within: Option<WithinSpec>,
    /// What reaches the points of `through_m` and `within`, and how.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach: Option<ReachSpec>,
    /// How often a list of points is gone through, back to the first; then the arm stays there. Without it
    /// the cycle goes on to the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1_000_000))]
    pub cycles: Option<u32>,
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

/// Random teaching points: places within a radius, evenly in the sphere. The way between two of them is
/// straight for the joints, not for the link.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WithinSpec {
    /// The radius \[m\].
    #[schemars(range(min = 0.0, max = 10.0))]
    pub radius_m: f64,
    /// Its centre, world frame \[m\]; by default where the posture has the link.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about_m: Option<[f64; 3]>,
    /// How far the link is turned from the posture's orientation at most, about a random axis \[rad\].
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 3.1))]
    pub turn_rad: f64,
    /// Draws so many points, and goes through them again and again; without it every point is a new one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000))]
    pub count: Option<u32>,
}

/// How a link reaches places.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReachSpec {
    /// The link; by default the one that holds tools.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The point of it that goes there, in its frame \[m\].
    pub point_m: [f64; 3],
    /// The position that each point is sought from, and that gives the link its orientation \[rad\]; by
    /// default the middle of each joint's range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub posture: Option<Vec<f64>>,
    /// Whether the link may turn as it likes; an arm with fewer than six joints needs that.
    pub any_orientation: bool,
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

/// The positions of a recording or of a table, joined by cubic splines.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotionSpec {
    /// The recording or table; relative to this file.
    pub path: PathBuf,
    /// Its topic (`sensor_msgs/msg/JointState`).
    #[serde(default = "default_motion_topic")]
    pub topic: String,
    /// Of a CSV table, which column is what; only times and positions are taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub columns: Option<CsvMapping>,
}

fn default_motion_topic() -> String {
    "/joint_states".to_owned()
}
