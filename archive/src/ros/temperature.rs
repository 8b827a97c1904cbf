//! `sensor_msgs/msg/Temperature`.

use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME};
use super::{DecodeError, Message};

/// `sensor_msgs/msg/Temperature`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Temperature {
    /// Stamp and frame.
    pub header: Header,
    /// \[deg C\]
    pub temperature: f64,
    /// 0 for unknown.
    pub variance: f64,
}

impl Message for Temperature {
    const TYPE: &'static str = "sensor_msgs/msg/Temperature";
    const TEXT: &'static str = "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[HEADER, TIME];
    const TYPE_HASH: &'static str =
        "RIHS01_72514a14126ab9f8a9abec974c78e5610a367b59db5da355ff1fb982d5bad4b8";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()
    }
}
