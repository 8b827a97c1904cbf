//! `geometry_msgs/msg/WrenchStamped`.

use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME};
use super::{DecodeError, Message};

pub(super) const VECTOR3: (&str, &str) =
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");

/// `geometry_msgs/msg/Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Vector3 {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
}

impl From<[f64; 3]> for Vector3 {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector3> for [f64; 3] {
    fn from(v: Vector3) -> Self {
        [v.x, v.y, v.z]
    }
}

/// `geometry_msgs/msg/Wrench`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Wrench {
    /// Force \[N\].
    pub force: Vector3,
    /// Torque \[N m\].
    pub torque: Vector3,
}

/// `geometry_msgs/msg/WrenchStamped`: a force and a torque in the header's frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct WrenchStamped {
    /// Time, and the frame the wrench is meant in.
    pub header: Header,
    /// The wrench.
    pub wrench: Wrench,
}

impl Message for WrenchStamped {
    const TYPE: &'static str = "geometry_msgs/msg/WrenchStamped";
    const TEXT: &'static str = "std_msgs/Header header\nWrench wrench\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[
        HEADER,
        TIME,
        ("geometry_msgs/Wrench", "Vector3 force\nVector3 torque\n"),
        VECTOR3,
    ];
    const TYPE_HASH: &'static str =
        "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()
    }
}
