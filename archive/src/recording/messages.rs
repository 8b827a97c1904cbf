//! Messages as they come out of a recording, whatever its format.

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
    /// The topic's place in [`Recording::topics`](super::Recording::topics).
    pub topic_index: usize,
    /// When it was received \[ns since the epoch\].
    pub log_time_ns: i64,
    /// When it was sent \[ns since the epoch\]; the log time where the format does not say.
    pub publish_time_ns: i64,
    /// The publisher's number for it, 0 where the format has none.
    pub sequence: u32,
    /// Where it lies: byte of the file where it or its chunk begins, row, or line.
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

    /// Decodes it over a message that is there already, whose memory is used again.
    ///
    /// # Errors
    /// [`ArchiveError::Decode`] if it is not an `M`; `message` is then void.
    pub fn decode_into<M: ros::Message>(&self, message: &mut M) -> Result<(), ArchiveError> {
        let body = self.sound_body();
        let decoded = body.and_then(|body| ros::decode_into(body, message));
        decoded.map_err(|source| self.error(source))
    }

    /// Decodes a joint state of its topic's type over one that is there already.
    ///
    /// # Errors
    /// [`ArchiveError::Decode`] if it is not of that type; `state` is then void.
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
    /// Log times of the messages that are given.
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

    /// The next message, `None` at the end.
    ///
    /// [`ArchiveError::Damaged`] stands in the place of what cannot be read: whoever asks again is
    /// given what comes behind it. After any other error there is nothing more.
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

    /// Chunks of an MCAP file or a bag of ROS 1 that have been read so far. Messages of an MCAP file that lie in no chunk
    /// count as one, up to the next chunk.
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
