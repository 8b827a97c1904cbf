//! What a cell tells its fleet: its status, and its alarms one by one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AlarmMessage, HealthMessage};

/// The only version of [`StatusMessage`] so far.
pub const STATUS_VERSION: u32 = 1;

/// Under `<cell>/status`: how the cell fares, once a second, and as the answer to a query.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatusMessage {
    /// Version of this message: 1.
    pub version: u32,
    /// The publisher's life, another one after each start: the last part of its liveliness token.
    pub instance: String,
    /// When this was sent, by the clock of the cell's computer \[ns since the epoch\].
    pub sent_ns: i64,
    /// The cell's computer.
    pub host: String,
    /// Version of tauscope there.
    pub tauscope: String,
    /// The robot's name in its URDF; empty without a URDF.
    pub robot: String,
    /// Unit of the measured effort: `Nm` or `A`.
    pub effort_unit: String,
    /// SHA-256 of the URDF; left out without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub urdf_sha256: Option<String>,
    /// SHA-256 of the twin's file; left out where the twin is the URDF alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twin_sha256: Option<String>,
    /// Where the cell's recorder writes archives and pictures, on its host, `*` for numbers and times in a name and `, `
    /// between names; left out without a recorder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub archive: Option<String>,
    /// Whether the cell's source takes commands.
    pub takes_commands: bool,
    /// Whether the run has ended in order: nothing follows.
    pub ended: bool,
    /// Where the alarm stands.
    pub alarm: AlarmMessage,
    /// Stamp of the newest sample \[ns since the epoch\]; left out before the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_sample_ns: Option<i64>,
    /// Time since that sample arrived \[ms\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_sample_age_ms: Option<u64>,
    /// Contacts that began since `contacts_since_ns`.
    pub contacts_today: u64,
    /// The later of 00:00 UTC, by the samples' stamps, and the publisher's first sample \[ns since the epoch\].
    pub contacts_since_ns: i64,
    /// The newest contact; left out before the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_contact: Option<ContactMessage>,
    /// Number of the newest [`RecordMessage`]; 0 before the first.
    pub last_record: u64,
    /// How the stages fare that this one listens to.
    pub stages: Vec<HealthMessage>,
    /// Samples that did not reach the publisher itself, and messages that it could not send.
    pub unsent: u64,
    /// The residual by joint; left out where the publisher does not listen to the twin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual: Option<ResidualMessage>,
    /// Changes of the arm that a watch reports now.
    pub changes: Vec<ChangeMessage>,
}

/// The answer to the query `<cell>/status?clock`: by it the fleet host knows how far the clocks differ.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ClockMessage {
    /// The publisher's life, as in [`StatusMessage`].
    pub instance: String,
    /// When the query came, by the clock of the cell's computer \[ns since the epoch\].
    pub received_ns: i64,
    /// When this was sent, by the same clock \[ns since the epoch\].
    pub answered_ns: i64,
}

/// A contact, as far as it is known by now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactMessage {
    /// Its number since the publisher started, from 1.
    pub number: u64,
    /// The detector that reported it first.
    pub detector: String,
    /// Its kind in the detector's words, e.g. `contact`, `collision`.
    pub kind: String,
    /// The touched link; left out where it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The other link that it may as well have been, where the first is not sure.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_link: Option<String>,
    /// Estimated beginning \[ns since the epoch\].
    pub begin_ns: i64,
    /// Stamp of the sample that raised the alarm \[ns since the epoch\].
    pub onset_ns: i64,
    /// Stamp of the sample that ended it \[ns since the epoch\]; left out while it lasts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_ns: Option<i64>,
    /// Length of the estimated force at the sample with the largest score \[N\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_force_n: Option<f64>,
    /// Whether the alarm was latched: somebody has to acknowledge it.
    pub latched: bool,
    /// Stamp from which it is acknowledged \[ns since the epoch\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acknowledged_ns: Option<i64>,
    /// Who acknowledged it, where that was told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acknowledged_by: Option<String>,
}

/// A change of the arm, as a watch over the residual reports it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChangeMessage {
    /// The effect's name, e.g. `payload`, `coulomb_friction`, or `unknown`.
    pub effect: String,
    /// The changed link; left out where it is a joint's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The joints that show it.
    pub joints: Vec<String>,
    /// Its size: \[kg\] for `payload`, a factor for `torque_gain`, else in the unit of the effect's parameter.
    pub size: f64,
    /// Since when \[ns since the epoch\].
    pub since_ns: i64,
}

/// The filtered residual of the last minute in which nothing touched the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualMessage {
    /// Stamp of its newest sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Stream time that it covers, at most 60 \[s\].
    pub window_s: f64,
    /// By joint, in URDF order.
    pub joints: Vec<JointResidual>,
}

/// A joint's residual \[effort unit\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JointResidual {
    /// The joint.
    pub name: String,
    /// Root mean square.
    pub rms: f64,
    /// Mean: its offset.
    pub mean: f64,
    /// Its standard deviation when the twin was calibrated; left out where the twin's file does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<f64>,
}

/// Under `<cell>/records`: a contact or a change of the arm, whenever more is known of it.
///
/// The newest 256 are kept: the query `<cell>/records?after=NUMBER` is answered with those behind that number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordMessage {
    /// The publisher's life, as in [`StatusMessage`].
    pub instance: String,
    /// Its number in this life, from 1; a hole means loss.
    pub number: u64,
    /// When it was told, by the clock of the cell's computer \[ns since the epoch\].
    pub sent_ns: i64,
    /// What it is about. A later record of the same contact replaces an earlier one.
    pub record: Record,
}

/// What a [`RecordMessage`] is about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    /// A contact.
    Contact(ContactMessage),
    /// A change of the arm.
    Change(ChangeMessage),
}
