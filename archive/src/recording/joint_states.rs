//! Joint states of one topic, decoded.

use super::messages::Messages;
use crate::error::ArchiveError;
use crate::ros::{JointState, JointStateDecoder};

/// A message with its receive and send times.
#[derive(Debug, Clone, Copy)]
pub struct Stamped<T> {
    /// Receive time \[ns since the epoch\].
    pub log_time_ns: i64,
    /// Send time \[ns since the epoch\].
    pub publish_time_ns: i64,
    /// The message.
    pub message: T,
}

/// Joint states of one topic in the order of their log times. All messages share the memory of one.
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

    /// Returns the next joint state, or `None` at the end. NaN values are kept.
    ///
    /// After an [`ArchiveError::Damaged`] or [`ArchiveError::Decode`], the next call continues with the next message.
    /// Any other error ends the sequence.
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
