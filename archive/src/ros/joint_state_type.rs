//! The message types that carry joint states, and their conversion to a [`JointState`].

use super::{DecodeError, DynamicJointState, JointState, Message, decode_into};

/// A message type that carries joint states.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointStateType {
    /// `sensor_msgs/msg/JointState`.
    JointState,
    /// `control_msgs/msg/DynamicJointState`.
    DynamicJointState,
}

impl JointStateType {
    /// All types, the most common one first.
    pub const ALL: [Self; 2] = [Self::JointState, Self::DynamicJointState];

    /// Returns the type of this name, e.g. `sensor_msgs/msg/JointState`.
    pub fn of(type_name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|each| each.name() == type_name)
    }

    /// Returns its name, e.g. `sensor_msgs/msg/JointState`.
    pub fn name(self) -> &'static str {
        match self {
            Self::JointState => JointState::TYPE,
            Self::DynamicJointState => DynamicJointState::TYPE,
        }
    }

    /// Returns the names of all types, for error messages.
    pub fn names() -> String {
        Self::ALL.map(Self::name).join(" or ")
    }

    /// Returns its name on DDS.
    pub fn dds_type(self) -> String {
        super::dds_type(self.name())
    }

    /// Returns its type hash.
    pub fn hash(self) -> &'static str {
        match self {
            Self::JointState => JointState::TYPE_HASH,
            Self::DynamicJointState => DynamicJointState::TYPE_HASH,
        }
    }
}

/// Decoder of joint states of any type. All messages share the memory of one.
#[derive(Debug, Default)]
pub struct JointStateDecoder {
    dynamic: DynamicJointState,
    /// Type of the last message that was decoded by [`JointStateDecoder::guess_into`].
    last: Option<JointStateType>,
}

impl JointStateDecoder {
    /// Decodes a message of this type into `state`.
    ///
    /// # Errors
    /// If `body` is not such a message; the content of `state` is then undefined.
    pub fn decode_into(
        &mut self,
        of: JointStateType,
        body: &[u8],
        state: &mut JointState,
    ) -> Result<(), DecodeError> {
        match of {
            JointStateType::JointState => decode_into(body, state),
            JointStateType::DynamicJointState => {
                decode_into(body, &mut self.dynamic)?;
                self.dynamic.write_to(state);
                Ok(())
            }
        }
    }

    /// Decodes a message of undeclared type into `state`, and returns its type. No message is valid as both types,
    /// because their lengths differ.
    ///
    /// # Errors
    /// The decoding error for the type of the last message, if the message is of no type; the content of `state` is
    /// then undefined.
    pub fn guess_into(
        &mut self,
        body: &[u8],
        state: &mut JointState,
    ) -> Result<JointStateType, DecodeError> {
        let likely = self.last.unwrap_or(JointStateType::JointState);
        let Err(error) = self.decode_into(likely, body, state) else {
            self.last = Some(likely);
            return Ok(likely);
        };
        for other in JointStateType::ALL {
            if other != likely && self.decode_into(other, body, state).is_ok() {
                self.last = Some(other);
                return Ok(other);
            }
        }
        Err(error)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

    use super::super::{InterfaceValue, encode};
    use super::*;

    #[test]
    fn the_type_of_a_message_is_found_from_its_bytes() {
        let names = vec!["a".to_owned(), "b".to_owned()];
        let plain = JointState {
            name: names.clone(),
            position: vec![1.0, 2.0],
            ..JointState::default()
        };
        let interfaces = |value| InterfaceValue {
            interface_names: vec!["position".to_owned()],
            values: vec![value],
        };
        let dynamic = DynamicJointState {
            joint_names: names,
            interface_values: vec![interfaces(1.0), interfaces(2.0)],
            ..DynamicJointState::default()
        };
        let (mut plain_body, mut dynamic_body) = (Vec::new(), Vec::new());
        encode(&plain, &mut plain_body).unwrap();
        encode(&dynamic, &mut dynamic_body).unwrap();
        let mut decoder = JointStateDecoder::default();
        let mut state = JointState::default();
        for (body, of) in [
            (&plain_body, JointStateType::JointState),
            (&dynamic_body, JointStateType::DynamicJointState),
            (&dynamic_body, JointStateType::DynamicJointState),
            (&plain_body, JointStateType::JointState),
        ] {
            assert_eq!(decoder.guess_into(body, &mut state).unwrap(), of);
            assert_eq!(state, plain);
        }
        assert!(decoder.guess_into(b"hello world", &mut state).is_err());
        // Without any joint, too, the two differ.
        for empty in [true, false] {
            let mut body = Vec::new();
            if empty {
                encode(&JointState::default(), &mut body).unwrap();
            } else {
                encode(&DynamicJointState::default(), &mut body).unwrap();
            }
            let expected = JointStateType::ALL[usize::from(!empty)];
            let mut decoder = JointStateDecoder::default();
            assert_eq!(decoder.guess_into(&body, &mut state).unwrap(), expected);
        }
    }
}
