//! ROS 2 messages over Zenoh, as `rmw_zenoh` publishes them.
//!
//! A message goes to the key `<domain>/<topic>/<DDS type>/<type hash>`: CDR, with an attachment of number, time and
//! publisher. A liveliness token tells `rmw_zenoh` of the node and of each publisher, so that `ros2 topic list` shows
//! them: `@ros2_lv/<domain>/<session>/<node>/<entity>/<kind>/<enclave>/<namespace>/<node name>`, and for a publisher
//! `/<topic>/<type>/<hash>/<QoS>` behind it, with `%` for each `/` within a part (`rmw_zenoh`, `docs/design.md`).

use std::collections::BTreeMap;
use std::time::SystemTime;

use tauscope_archive::ros::{self, Message};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Publisher;
use zenoh::qos::CongestionControl;
use zenoh::{Session, Wait as _};

use crate::config::Ros2Config;
use crate::error::PublishError;

/// The node that all publishers belong to.
const NODE: &str = "tauscope";
/// Quality of service in a token: the defaults (reliable, volatile) and the last 10 samples.
const QOS: &str = "::,10:,:,:,,";

/// A publisher of ROS 2 messages.
pub struct Ros2 {
    session: Session,
    domain: u32,
    namespace: String,
    /// Liveliness token of the node.
    _node: LivelinessToken,
    topics: BTreeMap<String, Topic>,
    body: Vec<u8>,
}

struct Topic {
    publisher: Publisher<'static>,
    _token: LivelinessToken,
    gid: [u8; 16],
    sequence: i64,
}

impl Ros2 {
    /// Opens a node in the namespace of `cell`.
    ///
    /// # Errors
    /// If Zenoh rejects its token.
    pub fn open(session: &Session, config: &Ros2Config, cell: &str) -> Result<Self, PublishError> {
        let namespace = config.namespace.as_deref().unwrap_or(cell);
        let namespace = ros_name(namespace.trim_matches('/'));
        let node = declare(session, &node_token(session, config.domain, &namespace))?;
        Ok(Self {
            session: session.clone(),
            domain: config.domain,
            namespace,
            _node: node,
            topics: BTreeMap::new(),
            body: Vec::new(),
        })
    }

    /// Announces a topic, below the namespace, before the first message.
    ///
    /// # Errors
    /// If Zenoh rejects its key.
    pub fn announce<M: Message>(&mut self, topic: &str) -> Result<(), PublishError> {
        self.topic::<M>(topic).map(|_| ())
    }

    /// Publishes a message without waiting; a subscriber that is too slow loses it, and sees a gap in the sequence.
    ///
    /// # Errors
    /// If the message or its key cannot be written.
    pub fn publish<M: Message>(&mut self, topic: &str, message: &M) -> Result<(), PublishError> {
        let mut body = std::mem::take(&mut self.body);
        ros::encode(message, &mut body)?;
        let topic = self.topic::<M>(topic)?;
        topic.sequence += 1;
        let attachment = attachment(topic.sequence, now_ns(), topic.gid);
        let sent = topic
            .publisher
            .put(body.as_slice())
            .attachment(attachment.as_slice())
            .wait()
            .map_err(PublishError::zenoh);
        self.body = body;
        sent
    }

    fn topic<M: Message>(&mut self, name: &str) -> Result<&mut Topic, PublishError> {
        if !self.topics.contains_key(name) {
            let topic = self.declare_topic::<M>(name)?;
            self.topics.insert(name.to_owned(), topic);
        }
        // It is there: it was inserted above where it was not.
        self.topics
            .get_mut(name)
            .ok_or_else(|| PublishError::Zenoh(name.to_owned()))
    }

    fn declare_topic<M: Message>(&self, name: &str) -> Result<Topic, PublishError> {
        let full = match self.namespace.as_str() {
            "" => ros_name(name),
            namespace => format!("{namespace}/{}", ros_name(name)),
        };
        let entity = self.topics.len() + 1;
        let (dds_type, hash) = (M::dds_type(), M::TYPE_HASH);
        let key = format!("{}/{full}/{dds_type}/{hash}", self.domain);
        let publisher = self
            .session
            .declare_publisher(key)
            .congestion_control(CongestionControl::Drop)
            .wait()
            .map_err(PublishError::zenoh)?;
        let token = format!(
            "{}/{}/{dds_type}/{hash}/{QOS}",
            entity_token(&self.session, self.domain, entity, "MP", &self.namespace),
            mangled(&format!("/{full}")),
        );
        // One of this session's, unlike any other session's.
        let mut gid = self.session.zid().to_le_bytes();
        for (byte, number) in gid.iter_mut().zip((entity as u64).to_le_bytes()) {
            *byte ^= number;
        }
        Ok(Topic {
            publisher,
            _token: declare(&self.session, &token)?,
            gid,
            sequence: 0,
        })
    }
}

fn node_token(session: &Session, domain: u32, namespace: &str) -> String {
    entity_token(session, domain, 0, "NN", namespace)
}

fn entity_token(
    session: &Session,
    domain: u32,
    entity: usize,
    kind: &str,
    namespace: &str,
) -> String {
    let namespace = match namespace {
        "" => "%".to_owned(),
        namespace => mangled(&format!("/{namespace}")),
    };
    let zid = session.zid();
    format!("@ros2_lv/{domain}/{zid}/0/{entity}/{kind}/%/{namespace}/{NODE}")
}

fn declare(session: &Session, token: &str) -> Result<LivelinessToken, PublishError> {
    session
        .liveliness()
        .declare_token(token.to_owned())
        .wait()
        .map_err(PublishError::zenoh)
}

fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

/// A name that ROS 2 takes: letters, digits and `_`.
pub fn ros_name(name: &str) -> String {
    name.replace('-', "_")
}

/// Number, time and publisher: little-endian i64, i64, the length 16, 16 bytes.
fn attachment(sequence: i64, source_ns: i64, gid: [u8; 16]) -> [u8; 33] {
    let mut bytes = [0; 33];
    bytes[..8].copy_from_slice(&sequence.to_le_bytes());
    bytes[8..16].copy_from_slice(&source_ns.to_le_bytes());
    bytes[16] = 16;
    bytes[17..].copy_from_slice(&gid);
    bytes
}

fn now_ns() -> i64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0, |since| since.as_nanos() as i64)
}
