//! `diagnostic_msgs/msg/DiagnosticArray`.

use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME};
use super::{DecodeError, Message};

/// Severity of a [`DiagnosticStatus`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// Normal operation.
    Ok = 0,
    /// A condition that needs attention.
    Warn = 1,
    /// A fault.
    Error = 2,
    /// An outdated report.
    Stale = 3,
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct KeyValue {
    /// Name of the value.
    pub key: String,
    /// Its value as text.
    pub value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// A [`Level`] as its number.
    pub level: u8,
    /// Name of the reporting component.
    pub name: String,
    /// Description of the status.
    pub message: String,
    /// The device or part to which it applies.
    pub hardware_id: String,
    /// Details.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// Time.
    pub header: Header,
    /// The reported statuses.
    pub status: Vec<DiagnosticStatus>,
}

impl Message for DiagnosticArray {
    const TYPE: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
    const TEXT: &'static str = "std_msgs/Header header\nDiagnosticStatus[] status\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[
        HEADER,
        TIME,
        (
            "diagnostic_msgs/DiagnosticStatus",
            "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n\
             string message\nstring hardware_id\nKeyValue[] values\n",
        ),
        ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    ];
    const TYPE_HASH: &'static str =
        "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()
    }
}
