//! ROS 2 messages: their types, their text, and their CDR bytes.
//!
//! Only the types that a recording of a robot arm needs. One file per message.

mod cdr;
mod diagnostic_array;
mod dynamic_joint_state;
mod float64;
mod header;
mod inertia_stamped;
mod joint_state;
mod joint_state_type;
mod std_bool;
mod temperature;
#[cfg(test)]
mod type_hash;
mod wrench_stamped;

use serde::Serialize;
use serde::de::DeserializeOwned;

pub use cdr::{DecodeError, EncodeError, decode, decode_into, encode};
pub use diagnostic_array::{DiagnosticArray, DiagnosticStatus, KeyValue, Level};
pub use dynamic_joint_state::{DynamicJointState, InterfaceValue};
pub use float64::Float64;
pub use header::{Header, Time};
pub use inertia_stamped::{Inertia, InertiaStamped};
pub use joint_state::{JointState, first_twice};
pub use joint_state_type::{JointStateDecoder, JointStateType};
pub use std_bool::Bool;
pub use temperature::Temperature;
pub use wrench_stamped::{Vector3, Wrench, WrenchStamped};

/// A message type of ROS 2.
pub trait Message: Serialize + DeserializeOwned + Default {
    /// Its name, e.g. `sensor_msgs/msg/JointState`.
    const TYPE: &'static str;
    /// Its own `.msg` text, without the types it refers to.
    const TEXT: &'static str;
    /// Name (`std_msgs/Header`) and text of each type it refers to, directly or not.
    const DEPENDENCIES: &'static [(&'static str, &'static str)];
    /// Its type hash as ROS 2 computes it (REP-2016, `RIHS01`).
    const TYPE_HASH: &'static str;

    /// Its name on DDS, e.g. `sensor_msgs::msg::dds_::JointState_`.
    fn dds_type() -> String {
        dds_type(Self::TYPE)
    }

    /// Its full text as the `ros2msg` encoding of MCAP has it: the message, then each dependency
    /// after a line of 80 `=` and a line with its name.
    fn definition() -> String {
        let mut text = String::from(Self::TEXT);
        for (name, dependency) in Self::DEPENDENCIES {
            text.push_str(&"=".repeat(80));
            text.push_str("\nMSG: ");
            text.push_str(name);
            text.push('\n');
            text.push_str(dependency);
        }
        text
    }

    /// Checks the rules that the type does not express: stamps are not negative, the lengths of arrays match.
    ///
    /// # Errors
    /// The first rule that is violated.
    fn check(&self) -> Result<(), DecodeError> {
        Ok(())
    }

    /// Reads the message into `self`, so that its memory is reused.
    ///
    /// # Errors
    /// If the bytes do not hold the fields; `self` is then partly overwritten.
    fn read<BO: byteorder::ByteOrder>(
        &mut self,
        from: &mut cdr_encoding::CdrDeserializer<'_, BO>,
    ) -> Result<(), cdr_encoding::Error> {
        *self = serde::Deserialize::deserialize(from)?;
        Ok(())
    }

    /// Reads the little-endian `fields` into `self`, if only numbers differ from the message in `self`. This is
    /// faster than [`Message::read`] with the same result. Returns `false` if more differs or the type does not
    /// support it; the content of `self` is then undefined.
    fn read_alike(&mut self, _fields: &[u8]) -> bool {
        false
    }
}

/// The DDS name of a ROS 2 type, e.g. `sensor_msgs::msg::dds_::JointState_` of
/// `sensor_msgs/msg/JointState`.
pub fn dds_type(ros_type: &str) -> String {
    match ros_type.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => format!("dds_::{ros_type}_"),
    }
}

/// The ROS 2 name of a type, e.g. `sensor_msgs/msg/JointState`, from its name in ROS 1 (`sensor_msgs/JointState`), in
/// IDL (`sensor_msgs::msg::JointState`) or on DDS (`sensor_msgs::msg::dds_::JointState_`). Other names stay.
pub(crate) fn ros2_type(name: &str) -> String {
    let slashes = name.replace("::", "/");
    let parts: Vec<&str> = slashes.split('/').collect();
    match parts.as_slice() {
        [package, kind, "dds_", name] => {
            let name = name.strip_suffix('_').unwrap_or(name);
            format!("{package}/{kind}/{name}")
        }
        [package, name] if !package.is_empty() => format!("{package}/msg/{name}"),
        _ => slashes,
    }
}

#[cfg(test)]
mod tests {
    use super::ros2_type;

    #[test]
    fn type_names_of_every_origin_are_one() {
        for name in [
            "sensor_msgs/msg/JointState",
            "sensor_msgs/JointState",
            "sensor_msgs::msg::JointState",
            "sensor_msgs::msg::dds_::JointState_",
        ] {
            assert_eq!(ros2_type(name), "sensor_msgs/msg/JointState");
        }
        assert_eq!(ros2_type("foxglove.JointStates"), "foxglove.JointStates");
        assert_eq!(ros2_type(""), "");
    }
}
