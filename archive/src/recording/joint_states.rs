//! Joint states of one topic, decoded.

use super::messages::Messages;
use crate::error::ArchiveError;
use crate::ros::{JointState, JointStateDecoder};

/// A message with the times of its way.
#[derive(Debug, Clone, Copy)]
pub struct Stamped<T> {
    /// When it was received \[ns since the epoch\].
    pub log_time_ns: i64,
    /// When it was sent \[ns since the epoch\].
    pub publish_time_ns: i64,
    /// The message.
    pub message: T,
}

/// Joint states of one topic in the order of their log times. One message's memory is used for all.
pub struct JointStates {
    messages: Messages,
    decoder: JointStateDecoder,
    state: JointState,
}

impl JointStates {
    pub(super) fn new(messages: Messages) -> Self {
        Self {
            messages,
            decoder: JointStateDecoder::default(),
            state: JointState::default(),
        }
    }

    /// The next joint state, `None` at the end. NaN is left in it.
    ///
    /// After an [`ArchiveError::Damaged`] or [`ArchiveError::Decode`] it goes on with the next
    /// message; after any other error there is nothing more.
    pub fn next_state(&mut self) -> Option<Result<Stamped<&JointState>, ArchiveError>> {
        let message = match self.messages.next_message()? {
            Ok(message) => message,
            Err(error) => return Some(Err(error)),
        };
        let (log_time_ns, publish_time_ns) = (message.log_time_ns, message.publish_time_ns);
        let decoded = message.joint_state_into(&mut self.decoder, &mut self.state);
        Some(decoded.map(|()| Stamped {
            log_time_ns,
            publish_time_ns,
            message: &self.state,
        }))
    }
}
