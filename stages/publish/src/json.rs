//! JSON under plain Zenoh keys, `<cell>/<topic>`.

use std::collections::BTreeMap;

use serde::Serialize;
use zenoh::bytes::Encoding;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait as _};

use crate::error::PublishError;

/// A publisher of JSON.
pub struct Json {
    session: Session,
    cell: String,
    topics: BTreeMap<String, Publisher<'static>>,
}

impl Json {
    /// Creates a publisher for the topics of `cell`.
    pub fn new(session: &Session, cell: &str) -> Self {
        Self {
            session: session.clone(),
            cell: cell.to_owned(),
            topics: BTreeMap::new(),
        }
    }

    /// Publishes a message without waiting; a subscriber that is too slow loses it.
    ///
    /// # Errors
    /// If the message or its key cannot be written.
    pub fn publish(&mut self, topic: &str, message: &impl Serialize) -> Result<(), PublishError> {
        let text = serde_json::to_string(message)?;
        if let Some(publisher) = self.topics.get(topic) {
            return publisher.put(text).wait().map_err(PublishError::zenoh);
        }
        let publisher = self
            .session
            .declare_publisher(format!("{}/{topic}", self.cell))
            .congestion_control(CongestionControl::Drop)
            .encoding(Encoding::APPLICATION_JSON)
            .wait()
            .map_err(PublishError::zenoh)?;
        publisher.put(text).wait().map_err(PublishError::zenoh)?;
        self.topics.insert(topic.to_owned(), publisher);
        Ok(())
    }
}
