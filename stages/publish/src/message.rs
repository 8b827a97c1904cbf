//! JSON messages. Their JSON Schema is generated from these types: `tauscope schema --messages`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::Health;

use crate::alarm::State;

mod status;

pub use status::{
    ChangeMessage, ClockMessage, ContactMessage, JointResidual, Record, RecordMessage,
    ResidualMessage, STATUS_VERSION, StatusMessage,
};

/// Under `<cell>/alarm`: the state of the alarm, and whether the robot may move.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlarmMessage {
    /// Stamp of the newest detection \[ns since the epoch\].
    pub stamp_ns: i64,
    /// State of the alarm.
    pub state: AlarmState,
    /// Whether the robot may move according to the detections.
    pub free: bool,
    /// Whether a detector sees a contact now, muted or not.
    pub contact: bool,
    /// Remaining time of a mute \[s\]; 0 without one.
    pub muted_s: f64,
    /// Time since a collision was latched, by a monotonic clock of the cell's computer \[ms\]. It increases until the
    /// latch is released, also while the detectors are silent. Left out if nothing is latched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub latched_for_ms: Option<u64>,
    /// The touched link; left out if there is none, or if it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The estimated force on the robot, world frame \[N\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub force_n: Option<[f64; 3]>,
}

impl AlarmMessage {
    /// Returns the message before the first detection.
    pub fn silent() -> Self {
        Self {
            stamp_ns: 0,
            state: AlarmState::Silent,
            free: false,
            contact: false,
            muted_s: 0.0,
            latched_for_ms: None,
            link: None,
            force_n: None,
        }
    }
}

/// States of the alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlarmState {
    /// No sample has arrived for too long, or the run has ended: stop.
    Silent,
    /// A detector cannot judge: stop.
    NotReady,
    /// Nothing touches the robot.
    Free,
    /// Something touches it: stop, unless muted.
    Contact,
    /// It has collided, and the collision is not acknowledged: stop.
    Collision,
    /// The acknowledged collision is not over yet: stop.
    Acknowledged,
}

impl AlarmState {
    /// Returns its number in a Modbus register.
    pub fn number(self) -> u16 {
        match self {
            Self::Silent => 0,
            Self::NotReady => 1,
            Self::Free => 2,
            Self::Contact => 3,
            Self::Collision => 4,
            Self::Acknowledged => 5,
        }
    }

    /// Returns its name in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Silent => "silent",
            Self::NotReady => "not_ready",
            Self::Free => "free",
            Self::Contact => "contact",
            Self::Collision => "collision",
            Self::Acknowledged => "acknowledged",
        }
    }
}

impl From<State> for AlarmState {
    fn from(state: State) -> Self {
        match state {
            State::NotReady => Self::NotReady,
            State::Free => Self::Free,
            State::Contact => Self::Contact,
            State::Collision => Self::Collision,
            State::Acknowledged => Self::Acknowledged,
        }
    }
}

/// Under `<cell>/detections/<detector>`: the verdict of a detector on a sample.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DetectionMessage {
    /// Stamp of the sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Number of the sample in the detector's stream; a gap means loss.
    pub sequence: u64,
    /// The detector's name.
    pub detector: String,
    /// State in the detector's own terms: `free`, `contact`, `collision`, ….
    pub state: String,
    /// Whether it judged this sample.
    pub ready: bool,
    /// Whether it sees a contact, or a change of the arm.
    pub alarm: bool,
    /// Begin or end of an alarm at this sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub event: Option<EventMessage>,
    /// The score, in the detector's own unit.
    pub score: f64,
    /// Score from which the detector raises an alarm.
    pub threshold: f64,
    /// Estimated beginning of the contact, while an alarm lasts \[ns since the epoch\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contact_ns: Option<i64>,
    /// The joints that detected.
    pub joints: Vec<String>,
    /// The touched link, if it is estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The alternative link, if the estimate is ambiguous.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub other_link: Option<String>,
    /// Estimated force on the robot, world frame \[N\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force_n: Option<[f64; 3]>,
    /// Assumed point of application of the force, world frame \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_m: Option<[f64; 3]>,
}

/// Begin or end of an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventMessage {
    /// The alarm is raised.
    Onset,
    /// The alarm ends.
    Offset,
}

/// Under `<cell>/joint_states`, `<cell>/twin/joint_states` and `<cell>/residual`: numbers by joint.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct JointsMessage {
    /// Stamp of the sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Number of the sample in the stream; a gap means loss.
    pub sequence: u64,
    /// The joints, in URDF order.
    pub name: Vec<String>,
    /// Position \[rad or m\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub position: Vec<f64>,
    /// Velocity \[rad/s or m/s\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub velocity: Vec<f64>,
    /// Effort in the cell's unit: measured, the twin's, or the residual \[N m, N or A\].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effort: Vec<f64>,
}

/// Under `<cell>/command`: an accepted command.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CommandMessage {
    /// Stamp of the sample from which it is in effect \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Verb of the command.
    pub verb: String,
    /// Arguments of the command, by name.
    pub arguments: std::collections::BTreeMap<String, String>,
}

/// Under `<cell>/health/<stage>`: the health of a stage, once a second.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct HealthMessage {
    /// Stamp of the stage's newest sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// The stage.
    pub stage: String,
    /// Number of received samples.
    pub received: u64,
    /// Number of emitted samples.
    pub emitted: u64,
    /// Number of samples that were lost or refused.
    pub dropped: u64,
    /// Number of restarts of the stage.
    pub restarts: u64,
}

impl From<&Health> for HealthMessage {
    fn from(health: &Health) -> Self {
        Self {
            stamp_ns: health.header.stamp_ns,
            stage: health.stage.to_string(),
            received: health.received,
            emitted: health.emitted,
            dropped: health.dropped,
            restarts: health.restarts,
        }
    }
}

/// All messages, by the topic after the cell's name. This type exists only for their schema.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(title = "tauscope messages")]
pub struct Messages {
    /// `<cell>/alarm`.
    pub alarm: AlarmMessage,
    /// `<cell>/detections/<detector>`.
    pub detections: DetectionMessage,
    /// `<cell>/joint_states`, `<cell>/twin/joint_states`, `<cell>/residual`.
    pub joints: JointsMessage,
    /// `<cell>/command`.
    pub command: CommandMessage,
    /// `<cell>/health/<stage>`.
    pub health: HealthMessage,
    /// `<cell>/status`.
    pub status: StatusMessage,
    /// Answer to the query `<cell>/status?clock`.
    pub clock: ClockMessage,
    /// `<cell>/records`.
    pub records: RecordMessage,
    /// Request to `<cell>/commands`.
    pub commands: tauscope_bus::command::Request,
    /// Answer to such a request.
    pub answer: tauscope_bus::command::Answer,
}
