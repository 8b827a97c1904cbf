//! Sequential access to the messages of a recording in any format.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::body::{Bodies, Flaw};
use crate::cursor::Cursor;
use crate::error::ArchiveError;
use crate::ros;
use crate::topic::{Topic, Topics};

/// A message of a recording.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its topic.
    pub topic: &'a Topic,
    /// Index of the topic in [`Recording::topics`](super::Recording::topics).
    pub topic_index: usize,
    /// Receive time \[ns since the epoch\].
    pub log_time_ns: i64,
    /// Send time \[ns since the epoch\]; the log time if the format has no send time.
    pub publish_time_ns: i64,
    /// Sequence number of the publisher; 0 if the format has none.
    pub sequence: u32,
    /// Position in the file: offset of the message or of its chunk \[bytes\], row, or line.
    pub at: u64,
    /// The message itself, in the topic's encoding.
    pub body: &'a [u8],
    /// Reason why `body` is not in the topic's encoding but as stored.
    flaw: Option<Flaw>,
    path: &'a Path,
}

impl Message<'_> {
    /// Decodes it.
    ///
    /// # Errors
    /// [`ArchiveError::Decode`] if it is not an `M`.
    pub fn decode<M: ros::Message>(&self) -> Result<M, ArchiveError> {
        let decoded = self.sound_body().and_then(ros::decode);
        decoded.map_err(|source| self.error(source))
    }

    /// Decodes it into an existing message, whose memory is reused.
    ///
    /// # Errors
    /// [`ArchiveError::Decode`] if it is not an `M`; the content of `message` is then undefined.
    pub fn decode_into<M: ros::Message>(&self, message: &mut M) -> Result<(), ArchiveError> {
        let body = self.sound_body();
        let decoded = body.and_then(|body| ros::decode_into(body, message));
        decoded.map_err(|source| self.error(source))
    }

    /// Decodes a joint state of its topic's type into an existing one.
    ///
    /// # Errors
    /// [`ArchiveError::Decode`] if it is not of that type; the content of `state` is then undefined.
    pub fn joint_state_into(
        &self,
        decoder: &mut ros::JointStateDecoder,
        state: &mut ros::JointState,
    ) -> Result<(), ArchiveError> {
        let of = self.topic.joint_state_type();
        let of = of.unwrap_or(ros::JointStateType::JointState);
        let body = self.sound_body();
        let decoded = body.and_then(|body| decoder.decode_into(of, body, state));
        decoded.map_err(|source| self.error(source))
    }

    fn sound_body(&self) -> Result<&[u8], ros::DecodeError> {
        match self.flaw {
            Some(flaw) => Err(flaw.error(self.body.len())),
            None => Ok(self.body),
        }
    }

    fn error(&self, source: ros::DecodeError) -> ArchiveError {
        ArchiveError::Decode {
            path: self.path.to_owned(),
            topic: self.topic.name.clone(),
            log_time_ns: self.log_time_ns,
            at: self.at,
            source,
        }
    }
}

/// Messages of a recording in the order of their log times.
///
/// No `Iterator`, because a message borrows the reader's memory:
/// `while let Some(message) = messages.next_message() { … }`.
pub struct Messages {
    path: PathBuf,
    topics: Arc<Topics>,
    cursor: Box<dyn Cursor>,
    bodies: Bodies,
    /// Range of log times of the messages to return.
    within_ns: RangeInclusive<i64>,
    ended: bool,
}

impl Messages {
    pub(super) fn new(
        path: &Path,
        topics: Arc<Topics>,
        cursor: Box<dyn Cursor>,
        within_ns: RangeInclusive<i64>,
    ) -> Self {
        Self {
            path: path.to_owned(),
            topics,
            cursor,
            bodies: Bodies::default(),
            within_ns,
            ended: false,
        }
    }

    /// Returns the next message, or `None` at the end.
    ///
    /// An unreadable part is returned as [`ArchiveError::Damaged`], and the next call continues behind it. Any other
    /// error ends the sequence.
    pub fn next_message(&mut self) -> Option<Result<Message<'_>, ArchiveError>> {
        while !self.ended {
            match self.cursor.advance() {
                Ok(true) => {
                    let log_time_ns = self.cursor.current()?.log_time_ns;
                    if self.within_ns.contains(&log_time_ns) {
                        return self.message().map(Ok);
                    }
                    self.ended = log_time_ns > *self.within_ns.end();
                }
                Ok(false) => self.ended = true,
                Err(error) => {
                    self.ended = error.damage().is_none();
                    return Some(Err(error));
                }
            }
        }
        None
    }

    /// Returns the number of chunks of an MCAP file or a bag of ROS 1 read so far. A run of messages of an MCAP file
    /// outside chunks counts as one chunk.
    pub fn chunks_read(&self) -> u64 {
        self.cursor.chunks_read()
    }

    fn message(&mut self) -> Option<Message<'_>> {
        let raw = self.cursor.current()?;
        let topic = &self.topics.list[raw.topic];
        let (body, flaw) = match topic.message_encoding.as_str() {
            "cdr" => (self.bodies).cdr(raw.body, self.topics.conversion(raw.topic)),
            _ => (raw.body, None),
        };
        Some(Message {
            topic,
            topic_index: raw.topic,
            log_time_ns: raw.log_time_ns,
            publish_time_ns: raw.publish_time_ns,
            sequence: raw.sequence,
            at: raw.at,
            body,
            flaw,
            path: &self.path,
        })
    }
}
