//! Errors of scenarios and their simulation.

use tauscope_archive::WriteError;
use tauscope_dynamics::terms::TermError;

use super::inverse::{Goal, Missed};

/// Errors of scenarios and their simulation.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// A simulated source opened without its scenario and robot.
    #[error("the scenario and its robot were not loaded")]
    NotLoaded,
    /// A link that the robot does not have.
    #[error("{what} is on link `{link}`, which the robot does not have; its links: {known}")]
    UnknownLink {
        /// Object that acts on the link.
        what: &'static str,
        /// The link in the file.
        link: String,
        /// The robot's links.
        known: String,
    },
    /// A push on a link that is fixed to the ground.
    #[error(
        "recording `{recording}`: {what} is on link `{link}`, which no joint moves: no joint would feel it; name a link that moves"
    )]
    FixedLink {
        /// The recording.
        recording: String,
        /// Object that acts on the link.
        what: &'static str,
        /// The link in the file.
        link: String,
    },
    /// A joint that the robot does not have.
    #[error("{what} names joint `{joint}`, which the robot does not have; its joints: {known}")]
    UnknownJoint {
        /// The key in the file.
        what: &'static str,
        /// The joint in the file.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// An effort in amperes for a joint without a torque constant.
    #[error(
        "effort_unit is A, but torque_constants_nm_per_a has no value above 0 for joint `{joint}`"
    )]
    NoTorqueConstant {
        /// The joint.
        joint: String,
    },
    /// An invalid effect.
    #[error(transparent)]
    Term(#[from] TermError),
    /// A number of motions other than one.
    #[error(
        "recording `{recording}`: `motion` has exactly one of `points`, `fourier` and `recorded`, found {found}"
    )]
    OneMotion {
        /// The recording.
        recording: String,
        /// Number of motions given.
        found: usize,
    },
    /// A position with the wrong number of joints.
    #[error("{what} has {found} values, the robot has {expected} joints")]
    JointCount {
        /// The key in the file.
        what: &'static str,
        /// Number of values in the file.
        found: usize,
        /// Number of joints of the robot.
        expected: usize,
    },
    /// A position outside the limits of a joint.
    #[error("{what}: {value} is outside of joint `{joint}`'s limits {lower} to {upper}")]
    OutsideLimits {
        /// The key in the file.
        what: &'static str,
        /// The joint.
        joint: String,
        /// The position.
        value: f64,
        /// Its lower limit.
        lower: f64,
        /// Its upper limit.
        upper: f64,
    },
    /// A place that no joint positions reach.
    #[error(
        "{what}: link `{link}` cannot reach [{}, {}, {}] m{}: at best it is {distance_m:.4} m and {angle_rad:.4} rad off. Move the point, start from another `reach.posture`{}",
        place_m[0], place_m[1], place_m[2],
        if *oriented { " with its posture's orientation" } else { "" },
        if *oriented { ", or allow `reach.any_orientation: true`" } else { "" },
    )]
    OutOfReach {
        /// The key in the file.
        what: String,
        /// The link.
        link: String,
        /// The place in the world \[m\].
        place_m: [f64; 3],
        /// Whether the orientation matters.
        oriented: bool,
        /// Smallest distance of the link from the place \[m\].
        distance_m: f64,
        /// Angle between the link's orientation there and the wanted one \[rad\].
        angle_rad: f64,
    },
    /// A minimum height that no random point keeps.
    #[error(
        "none of {tries} random points keeps every link {min_height_m} m above the base: take a smaller `range` or `min_height_m`"
    )]
    NoPoint {
        /// Number of points tried.
        tries: usize,
        /// The minimum height \[m\].
        min_height_m: f64,
    },
    /// An invalid range or time.
    #[error("{what}: {reason}")]
    Range {
        /// The key in the file.
        what: &'static str,
        /// Reason why it is invalid.
        reason: String,
    },
    /// More joints than a sample holds.
    #[error("{found} joints, at most {limit} are supported")]
    TooManyJoints {
        /// Number of joints.
        found: usize,
        /// Maximum number of joints.
        limit: usize,
    },
    /// A recording that the scenario does not make, or makes twice.
    #[error("recording `{name}` {reason}; the scenario makes {known}")]
    Recording {
        /// The name.
        name: String,
        /// Reason why it is refused.
        reason: &'static str,
        /// The scenario's recordings.
        known: String,
    },
    /// Elasticity and backlash, or two of either, in the same joint.
    #[error(
        "joint `{joint}` has more than one of `joint_elasticity` and `backlash`: one at most is simulated"
    )]
    TwoTransmissions {
        /// The joint.
        joint: String,
    },
    /// Effects that cannot be concealed.
    #[error("conceal: {reason}")]
    Conceal {
        /// Reason.
        reason: String,
    },
    /// An effect that the simulated arm cannot have.
    #[error("the physics' `{effect}` is not simulated: {reason}")]
    NotSimulated {
        /// The effect.
        effect: &'static str,
        /// Reason.
        reason: &'static str,
    },
    /// A runaway arm: the controller is unstable with this physics.
    #[error(
        "joint `{joint}` runs away {time_s:.3} s into recording `{recording}`: a stiffer effect than the controller can hold"
    )]
    Unstable {
        /// The recording.
        recording: String,
        /// The joint.
        joint: String,
        /// Time since the start of the recording \[s\].
        time_s: f64,
    },
    /// A recorded motion that cannot be read.
    #[error("recorded motion: {0}")]
    Motion(#[source] Box<crate::IngestError>),
    /// A recording that cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// Labels that cannot be written.
    #[error("{}: {source}", path.display())]
    Labels {
        /// The file.
        path: std::path::PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
}

impl ScenarioError {
    /// Creates the error for a missed goal.
    pub(super) fn out_of_reach(what: String, link: &str, goal: &Goal, missed: Missed) -> Self {
        Self::OutOfReach {
            what,
            link: link.to_owned(),
            place_m: goal.place.into(),
            oriented: goal.orientation.is_some(),
            distance_m: missed.distance_m,
            angle_rad: missed.angle_rad,
        }
    }
}
