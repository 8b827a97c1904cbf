//! Conversion of ROS 1 messages to the ROS 2 messages with the same content.
//!
//! ROS 1 writes the fields of a message one after the other, little endian, without padding, each text and array
//! behind its length (<http://wiki.ros.org/ROS/Technical%20Overview>).

use crate::fields::Fields;
use crate::ros::{self, Bool, DecodeError, Header, JointState, Message, Time};

/// ROS 1 message types that are converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Conversion {
    /// `sensor_msgs/JointState`.
    JointState,
    /// `std_msgs/Bool`.
    Bool,
}

impl Conversion {
    /// Conversion for the type with this ROS 2 name.
    pub(crate) fn of(type_name: &str) -> Option<Self> {
        let all = [Self::JointState, Self::Bool];
        all.into_iter().find(|each| each.type_name() == type_name)
    }

    /// Whether the publisher used the known definition. Tools without the definition write `*` or nothing.
    pub(crate) fn fits(self, md5sum: &str) -> bool {
        md5sum == self.md5sum() || matches!(md5sum, "" | "*")
    }

    /// Name of the type in ROS 2.
    pub(crate) fn type_name(self) -> &'static str {
        match self {
            Self::JointState => JointState::TYPE,
            Self::Bool => Bool::TYPE,
        }
    }

    /// Hash of the type in ROS 2.
    pub(crate) fn type_hash(self) -> &'static str {
        match self {
            Self::JointState => JointState::TYPE_HASH,
            Self::Bool => Bool::TYPE_HASH,
        }
    }

    /// Hash of the definition in ROS 1.
    fn md5sum(self) -> &'static str {
        match self {
            Self::JointState => "3066dcd76a6cfaef579bd0f34173e9fd",
            Self::Bool => "8b94c1b53db61fb6aed406028ad6332a",
        }
    }
}

/// Reusable memory for conversions.
#[derive(Default)]
pub(crate) struct Converter {
    state: JointState,
}

impl Converter {
    /// Converts the ROS 1 message `body` to CDR and writes it over `into`.
    ///
    /// # Errors
    /// [`DecodeError::Ros1`] if `body` is not such a message; `into` is then undefined.
    pub(crate) fn convert(
        &mut self,
        of: Conversion,
        body: &[u8],
        into: &mut Vec<u8>,
    ) -> Result<(), DecodeError> {
        let mut fields = Fields(body);
        let encoded = match of {
            Conversion::JointState => read_joint_state(&mut fields, &mut self.state)
                .map(|()| ros::encode(&self.state, into)),
            Conversion::Bool => fields.take(1).map(|data| {
                let data = data[0] != 0;
                ros::encode(&Bool { data }, into)
            }),
        };
        if matches!(encoded, Some(Ok(()))) && fields.0.is_empty() {
            return Ok(());
        }
        Err(DecodeError::Ros1 {
            len: body.len(),
            type_name: of.type_name(),
        })
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
