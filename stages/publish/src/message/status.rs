//! Messages of a cell to its fleet: its status, and each of its alarms.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{AlarmMessage, HealthMessage};

/// Version of [`StatusMessage`]; the only one so far.
pub const STATUS_VERSION: u32 = 1;

/// Under `<cell>/status`: the status of the cell, once a second and as the answer to a query.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StatusMessage {
    /// Version of this message: 1.
    pub version: u32,
    /// Id of this run of the publisher, new after each start: the last part of its liveliness token.
    pub instance: String,
    /// Time of sending, by the clock of the cell's computer \[ns since the epoch\].
    pub sent_ns: i64,
    /// Name of the cell's computer.
    pub host: String,
    /// Version of tauscope on it.
    pub tauscope: String,
    /// The robot's name in its URDF; empty without a URDF.
    pub robot: String,
    /// Unit of the measured effort: `Nm` or `A`.
    pub effort_unit: String,
    /// SHA-256 of the URDF; left out without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub urdf_sha256: Option<String>,
    /// SHA-256 of the twin's file; left out if the twin is the URDF alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub twin_sha256: Option<String>,
    /// Paths of the recorder's archives and pictures on the cell's host, with `*` for numbers and times in a name and
    /// `, ` between names; left out without a recorder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub archive: Option<String>,
    /// Whether the cell's source accepts commands.
    pub takes_commands: bool,
    /// Whether the run has ended normally: no message follows.
    pub ended: bool,
    /// State of the alarm.
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
    /// Health of the publisher's input stages.
    pub stages: Vec<HealthMessage>,
    /// Number of samples that did not reach the publisher, and of messages that it could not send.
    pub unsent: u64,
    /// The residual by joint; left out if the twin is not an input of the publisher.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual: Option<ResidualMessage>,
    /// Changes of the arm that a watch reports now.
    pub changes: Vec<ChangeMessage>,
}

/// The answer to the query `<cell>/status?clock`, from which the fleet host estimates the clock offset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ClockMessage {
    /// Id of this run of the publisher, as in [`StatusMessage`].
    pub instance: String,
    /// Time of arrival of the query, by the clock of the cell's computer \[ns since the epoch\].
    pub received_ns: i64,
    /// Time of sending, by the same clock \[ns since the epoch\].
    pub answered_ns: i64,
}

/// A contact, as known so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContactMessage {
    /// Its number since the publisher started, from 1.
    pub number: u64,
    /// The detector that reported it first.
    pub detector: String,
    /// Its kind in the detector's own terms, e.g. `contact`, `collision`.
    pub kind: String,
    /// The touched link; left out if it is unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The alternative link, if the estimate is ambiguous.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_link: Option<String>,
    /// Estimated beginning \[ns since the epoch\].
    pub begin_ns: i64,
    /// Stamp of the sample that raised the alarm \[ns since the epoch\].
    pub onset_ns: i64,
    /// Stamp of the sample that ended it \[ns since the epoch\]; left out while it lasts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_ns: Option<i64>,
    /// Magnitude of the estimated force at the sample with the largest score \[N\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_force_n: Option<f64>,
    /// Whether the alarm was latched and must be acknowledged.
    pub latched: bool,
    /// Stamp from which it is acknowledged \[ns since the epoch\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acknowledged_ns: Option<i64>,
    /// Person or program that acknowledged it, if reported.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acknowledged_by: Option<String>,
}

/// A change of the arm, reported by a watch over the residual.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ChangeMessage {
    /// The effect's name, e.g. `payload`, `coulomb_friction`, or `unknown`.
    pub effect: String,
    /// The changed link; left out for a change of joints.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link: Option<String>,
    /// The joints that show it.
    pub joints: Vec<String>,
    /// Its size: \[kg\] for `payload`, a factor for `torque_gain`, else in the unit of the effect's parameter.
    pub size: f64,
    /// Time of the change \[ns since the epoch\].
    pub since_ns: i64,
}

/// The filtered residual of the last minute in which nothing touched the robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResidualMessage {
    /// Stamp of its newest sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Stream time that it covers, at most 60 \[s\].
    pub window_s: f64,
    /// Residuals of the joints, in URDF order.
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
    /// Its standard deviation at the twin's calibration; left out if the twin's file lacks it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibrated: Option<f64>,
}

/// Under `<cell>/records`: a contact or a change of the arm, sent whenever more is known of it.
///
/// The newest 256 are kept: the query `<cell>/records?after=NUMBER` returns those after that number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RecordMessage {
    /// Id of this run of the publisher, as in [`StatusMessage`].
    pub instance: String,
    /// Number of the record in this run, from 1; a gap means loss.
    pub number: u64,
    /// Time of sending, by the clock of the cell's computer \[ns since the epoch\].
    pub sent_ns: i64,
    /// Contact or change. A later record of the same contact replaces an earlier one.
    pub record: Record,
}

/// Subject of a [`RecordMessage`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Record {
    /// A contact.
    Contact(ContactMessage),
    /// A change of the arm.
    Change(ChangeMessage),
}
