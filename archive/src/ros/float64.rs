//! `std_msgs/msg/Float64`.

use serde::{Deserialize, Serialize};

use super::Message;

/// `std_msgs/msg/Float64`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Float64 {
    /// The value.
    pub data: f64,
}

impl Message for Float64 {
    const TYPE: &'static str = "std_msgs/msg/Float64";
    const TEXT: &'static str = "float64 data\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[];
    const TYPE_HASH: &'static str =
        "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a";
}
