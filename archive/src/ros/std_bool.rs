//! `std_msgs/msg/Bool`.

use serde::{Deserialize, Serialize};

use super::Message;

/// `std_msgs/msg/Bool`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Bool {
    /// The value.
    pub data: bool,
}

impl Message for Bool {
    const TYPE: &'static str = "std_msgs/msg/Bool";
    const TEXT: &'static str = "bool data\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[];
    const TYPE_HASH: &'static str =
        "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9";
}
