//! Messages of ROS 1 as the messages of ROS 2 that carry the same.
//!
//! ROS 1 writes the fields of a message one after the other, little endian, without padding, each text and array
//! behind its length (<http://wiki.ros.org/ROS/Technical%20Overview>).

use crate::fields::Fields;
use crate::ros::{self, Bool, Header, JointState, Message, Time};

/// A message type that is read from bags of ROS 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Conversion {
    /// `sensor_msgs/JointState`.
    JointState,
    /// `std_msgs/Bool`.
    Bool,
}

impl Conversion {
    /// The one for a type of this name and definition. Tools that do not know the definition write `*`.
    pub(super) fn of(type_name: &str, md5sum: &str) -> Option<Self> {
        let known = Self::named(type_name)?;
        let same = md5sum == known.md5sum() || matches!(md5sum, "" | "*");
        same.then_some(known)
    }

    /// The one for a type of this name, whatever its definition.
    pub(super) fn named(type_name: &str) -> Option<Self> {
        match type_name {
            "sensor_msgs/JointState" => Some(Self::JointState),
            "std_msgs/Bool" => Some(Self::Bool),
            _ => None,
        }
    }

    /// Name and hash of the type in ROS 2.
    pub(super) fn ros2_type(self) -> (&'static str, &'static str) {
        match self {
            Self::JointState => (JointState::TYPE, JointState::TYPE_HASH),
            Self::Bool => (Bool::TYPE, Bool::TYPE_HASH),
        }
    }

    /// What ROS 1 knows the definition by.
    fn md5sum(self) -> &'static str {
        match self {
            Self::JointState => "3066dcd76a6cfaef579bd0f34173e9fd",
            Self::Bool => "8b94c1b53db61fb6aed406028ad6332a",
        }
    }
}

/// Converts messages; uses its memory again.
#[derive(Default)]
pub(super) struct Converter {
    state: JointState,
    body: Vec<u8>,
}

impl Converter {
    /// The message in `body` as CDR.
    ///
    /// # Errors
    /// In words, if `body` is not such a message.
    pub(super) fn convert(&mut self, of: Conversion, body: &[u8]) -> Result<&[u8], String> {
        let mut fields = Fields(body);
        let read = match of {
            Conversion::JointState => read_joint_state(&mut fields, &mut self.state),
            Conversion::Bool => fields.take(1).map(|_| ()),
        };
        let (type_name, _) = of.ros2_type();
        if read.is_none() || !fields.0.is_empty() {
            let len = body.len();
            return Err(format!("message of {len} bytes that is no {type_name}"));
        }
        let encoded = match of {
            Conversion::JointState => ros::encode(&self.state, &mut self.body),
            Conversion::Bool => {
                let data = body[0] != 0;
                ros::encode(&Bool { data }, &mut self.body)
            }
        };
        encoded.map_err(|error| error.to_string())?;
        Ok(&self.body)
    }
}

fn read_joint_state(fields: &mut Fields<'_>, state: &mut JointState) -> Option<()> {
    let _sequence = fields.u32()?;
    let stamp = Time {
        // ROS 1 counts seconds up to 2106, ROS 2 up to 2038.
        sec: i32::try_from(fields.u32()?).ok()?,
        nanosec: fields.u32()?,
    };
    state.header = Header {
        stamp,
        frame_id: fields.text()?.to_owned(),
    };
    let names = fields.u32()?;
    state.name.clear();
    for _ in 0..names {
        state.name.push(fields.text()?.to_owned());
    }
    for array in [&mut state.position, &mut state.velocity, &mut state.effort] {
        let len = fields.u32()? as usize;
        let values = fields.take(len.checked_mul(size_of::<f64>())?)?;
        let mut values = Fields(values);
        array.clear();
        array.extend(std::iter::from_fn(|| values.f64()));
    }
    Some(())
}
