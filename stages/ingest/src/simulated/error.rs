//! Why a scenario cannot be simulated.

use tauscope_archive::WriteError;
use tauscope_dynamics::terms::TermError;

use super::inverse::{Goal, Missed};

/// Why a scenario cannot be simulated.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// Whoever opens a simulated source must bring the scenario and its robot.
    #[error("the scenario and its robot were not loaded")]
    NotLoaded,
    /// A link that the robot has not.
    #[error("{what} is on link `{link}`, which the robot does not have; its links: {known}")]
    UnknownLink {
        /// What is to act there.
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
        /// What is to act there.
        what: &'static str,
        /// The link in the file.
        link: String,
    },
    /// A joint that the robot has not.
    #[error("{what} names joint `{joint}`, which the robot does not have; its joints: {known}")]
    UnknownJoint {
        /// The key in the file.
        what: &'static str,
        /// The joint in the file.
        joint: String,
        /// The robot's joints.
        known: String,
    },
    /// The effort is a current, and a joint has no torque constant.
    #[error(
        "effort_unit is A, but torque_constants_nm_per_a has no value above 0 for joint `{joint}`"
    )]
    NoTorqueConstant {
        /// The joint.
        joint: String,
    },
    /// An effect that cannot be suffered.
    #[error(transparent)]
    Term(#[from] TermError),
    /// Not exactly one kind of motion.
    #[error(
        "recording `{recording}`: `motion` has exactly one of `points`, `fourier` and `recorded`, found {found}"
    )]
    OneMotion {
        /// The recording.
        recording: String,
        /// How many were given.
        found: usize,
    },
    /// A position of another robot.
    #[error("{what} has {found} values, the robot has {expected} joints")]
    JointCount {
        /// The key in the file.
        what: &'static str,
        /// Values there.
        found: usize,
        /// Joints of the robot.
        expected: usize,
    },
    /// A point that the robot cannot take.
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
    /// A place that no position of the joints reaches.
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
        /// How far the link stays away \[m\].
        distance_m: f64,
        /// How far it stays turned \[rad\].
        angle_rad: f64,
    },
    /// No random point is high enough.
    #[error(
        "none of {tries} random points keeps every link {min_height_m} m above the base: take a smaller `range` or `min_height_m`"
    )]
    NoPoint {
        /// Points that were tried.
        tries: usize,
        /// The height wanted.
        min_height_m: f64,
    },
    /// Two numbers the wrong way round, or a time that is none.
    #[error("{what}: {reason}")]
    Range {
        /// The key in the file.
        what: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// More joints than a sample has room for.
    #[error("{found} joints, at most {limit} are supported")]
    TooManyJoints {
        /// How many there are.
        found: usize,
        /// How many fit.
        limit: usize,
    },
    /// A recording that the scenario does not make, or makes twice.
    #[error("recording `{name}` {reason}; the scenario makes {known}")]
    Recording {
        /// The name.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
        /// The recordings there are.
        known: String,
    },
    /// Elasticity and play, or two of one, in the same joint.
    #[error(
        "joint `{joint}` has more than one of `joint_elasticity` and `backlash`: one at most is simulated"
    )]
    TwoTransmissions {
        /// The joint.
        joint: String,
    },
    /// What cannot be concealed.
    #[error("conceal: {reason}")]
    Conceal {
        /// Why.
        reason: String,
    },
    /// An effect that the simulated arm cannot have.
    #[error("the physics' `{effect}` is not simulated: {reason}")]
    NotSimulated {
        /// The effect.
        effect: &'static str,
        /// Why not.
        reason: &'static str,
    },
    /// The arm ran away: the controller is unstable with this physics.
    #[error(
        "joint `{joint}` runs away {time_s:.3} s into recording `{recording}`: a stiffer effect than the controller can hold"
    )]
    Unstable {
        /// The recording.
        recording: String,
        /// The joint.
        joint: String,
        /// When \[s\].
        time_s: f64,
    },
    /// The recorded motion cannot be read.
    #[error("recorded motion: {0}")]
    Motion(#[source] Box<crate::IngestError>),
    /// A recording cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The labels cannot be written.
    #[error("{}: {source}", path.display())]
    Labels {
        /// The file.
        path: std::path::PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
}

impl ScenarioError {
    /// A goal that was missed.
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
