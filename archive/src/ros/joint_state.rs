//! `sensor_msgs/msg/JointState`.

use byteorder::ByteOrder;
use cdr_encoding::CdrDeserializer;
use serde::{Deserialize, Serialize};

use super::header::{HEADER, Header, TIME, Time};
use super::{DecodeError, Message};

/// `sensor_msgs/msg/JointState`: position \[rad or m\], velocity \[rad/s or m/s\] and effort
/// \[N m, N, or A with some drivers\] of named joints, in no fixed order. Each array is empty or as
/// long as `name`. Entries may be NaN.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointState {
    /// Time of the measurement.
    pub header: Header,
    /// Names of the joints.
    pub name: Vec<String>,
    /// Their positions, or empty.
    pub position: Vec<f64>,
    /// Their velocities, or empty.
    pub velocity: Vec<f64>,
    /// Their efforts, or empty.
    pub effort: Vec<f64>,
}

impl Message for JointState {
    const TYPE: &'static str = "sensor_msgs/msg/JointState";
    const TEXT: &'static str = "std_msgs/Header header\nstring[] name\nfloat64[] position\n\
                                float64[] velocity\nfloat64[] effort\n";
    const DEPENDENCIES: &'static [(&'static str, &'static str)] = &[HEADER, TIME];
    const TYPE_HASH: &'static str =
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";

    fn check(&self) -> Result<(), DecodeError> {
        self.header.stamp.check()?;
        for (array, len) in [
            ("position", self.position.len()),
            ("velocity", self.velocity.len()),
            ("effort", self.effort.len()),
        ] {
            if len != 0 && len != self.name.len() {
                return Err(DecodeError::ArrayLength {
                    array,
                    len,
                    names: self.name.len(),
                });
            }
        }
        Ok(())
    }

    // The one message that comes a thousand times a second: field by field into the memory that is
    // there already.
    fn read<BO: ByteOrder>(
        &mut self,
        from: &mut CdrDeserializer<'_, BO>,
    ) -> Result<(), cdr_encoding::Error> {
        self.header.stamp = Time::deserialize(&mut *from)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.header.frame_id)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.name)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.position)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.velocity)?;
        Deserialize::deserialize_in_place(&mut *from, &mut self.effort)
    }
}
