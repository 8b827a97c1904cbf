//! Publications of others on Zenoh, read from keys and from the tokens with which ROS 2 announces its publishers.

use std::collections::{BTreeMap, BTreeSet};

use tauscope_archive::ros::{self, JointStateType};

use super::attachment::Attachment;

/// Maximum number of keys remembered; messages of further keys are only counted.
const MAX_KEYS: usize = 256;
/// Number of messages of a key that are decoded.
const LOOKED_INTO: u64 = 50;
/// Maximum number of joint names, and of publishers, remembered per key.
const MAX_NAMES: usize = 64;
/// Maximum size of a joint state.
const MAX_PAYLOAD_BYTES: usize = 65_536;
/// Replacements of `/` within a part of a token: by `rmw_zenoh`, by `zenoh-bridge-ros2dds`.
const SLASHES: [char; 2] = ['%', '§'];

/// Forms of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Form {
    /// `<domain>/<topic>/<type>/<type hash>`.
    Rmw {
        /// `ROS_DOMAIN_ID`.
        domain: u32,
        /// The topic, with its slash.
        topic: String,
    },
    /// Any other key.
    Plain,
}

/// Observations of one key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Publication {
    /// Form of the key.
    pub form: Form,
    /// Type such as `sensor_msgs/msg/JointState`, if known.
    pub type_name: Option<String>,
    /// Number of announced publishers.
    pub announced: usize,
    /// Number of received messages.
    pub heard: u64,
    /// Joints that its messages name.
    pub joints: Vec<String>,
    /// Publishers that the messages name.
    senders: BTreeSet<[u8; 16]>,
}

impl Publication {
    fn new(form: Form, type_name: Option<String>) -> Self {
        Self {
            form,
            type_name,
            announced: 0,
            heard: 0,
            joints: Vec::new(),
            senders: BTreeSet::new(),
        }
    }

    /// Whether it carries joint states.
    pub fn is_joint_state(&self) -> bool {
        self.type_name
            .as_deref()
            .is_some_and(|name| JointStateType::of(name).is_some())
    }

    /// Returns the number of known publishers.
    pub fn publishers(&self) -> usize {
        self.announced.max(self.senders.len())
    }

    fn look_into(&mut self, payload: &[u8]) {
        let mut state = ros::JointState::default();
        if payload.len() > MAX_PAYLOAD_BYTES {
            return;
        }
        let of = ros::JointStateDecoder::default().guess_into(payload, &mut state);
        if let Ok(of) = of
            && !state.name.is_empty()
            && state.name.iter().all(|name| !name.is_empty())
        {
            self.type_name.get_or_insert_with(|| of.name().to_owned());
            for name in state.name {
                if self.joints.len() < MAX_NAMES && !self.joints.contains(&name) {
                    self.joints.push(name);
                }
            }
        }
    }
}

/// All publications observed on a session.
#[derive(Debug, Clone, Default)]
pub(super) struct Publications {
    /// Publications by key, without the hash of the type.
    pub by_key: BTreeMap<String, Publication>,
    /// Number of messages and tokens of keys beyond [`MAX_KEYS`].
    pub more: u64,
}

impl Publications {
    /// Records a message.
    pub fn hear(&mut self, key: &str, payload: &[u8], attachment: Option<Attachment>) {
        let (name, form, type_name) = read_key(key);
        let Some(publication) = self.entry(name, form, type_name) else {
            return;
        };
        publication.heard += 1;
        if publication.heard <= LOOKED_INTO {
            publication.look_into(payload);
        }
        if let Some(attachment) = attachment
            && publication.senders.len() < MAX_NAMES
        {
            publication.senders.insert(attachment.publisher);
        }
    }

    /// Records the token of a publisher; ignores other tokens.
    pub fn announce(&mut self, token: &str) {
        let Some((name, form, type_name)) = read_token(token) else {
            return;
        };
        if let Some(publication) = self.entry(name, form, Some(type_name)) {
            publication.announced += 1;
        }
    }

    fn entry(
        &mut self,
        name: String,
        form: Form,
        type_name: Option<String>,
    ) -> Option<&mut Publication> {
        if self.by_key.len() >= MAX_KEYS && !self.by_key.contains_key(&name) {
            self.more += 1;
            return None;
        }
        let publication = self
            .by_key
            .entry(name)
            .or_insert_with(|| Publication::new(form, None));
        publication.type_name = publication.type_name.take().or(type_name);
        Some(publication)
    }
}

/// Returns the key without the type's hash, its form, and its type if the key contains it.
fn read_key(key: &str) -> (String, Form, Option<String>) {
    let parts: Vec<&str> = key.split('/').collect();
    if let [domain, topic @ .., dds_type, hash] = &parts[..]
        && hash.starts_with("RIHS")
        && let (Ok(domain), Some(type_name)) = (domain.parse(), ros_type(dds_type))
    {
        return rmw(domain, &topic.join("/"), dds_type, type_name);
    }
    (key.to_owned(), Form::Plain, None)
}

fn rmw(
    domain: u32,
    topic: &str,
    dds_type: &str,
    type_name: String,
) -> (String, Form, Option<String>) {
    let name = format!("{domain}/{topic}/{dds_type}");
    let topic = format!("/{topic}");
    (name, Form::Rmw { domain, topic }, Some(type_name))
}

/// Parses a publisher's token like a key:
/// `@ros2_lv/<domain>/<session>/<node>/<entity>/MP/<enclave>/<namespace>/<node name>/<topic>/<type>/<hash>/<qos>` or
/// `@/<session>/@ros2_lv/MP/<key>/<type>/<qos>`.
fn read_token(token: &str) -> Option<(String, Form, String)> {
    let parts: Vec<&str> = token.split('/').collect();
    match &parts[..] {
        [
            "@ros2_lv",
            domain,
            _,
            _,
            _,
            "MP",
            _,
            _,
            _,
            topic,
            dds_type,
            ..,
        ] => {
            let topic = topic.replace(SLASHES, "/");
            let type_name = ros_type(dds_type)?;
            let domain = domain.parse().ok()?;
            let (name, form, _) = rmw(domain, topic.trim_matches('/'), dds_type, type_name.clone());
            Some((name, form, type_name))
        }
        ["@", _, "@ros2_lv", "MP", key, type_name, ..] => Some((
            key.replace(SLASHES, "/"),
            Form::Plain,
            type_name.replace(SLASHES, "/"),
        )),
        _ => None,
    }
}

/// `sensor_msgs/msg/JointState` for `sensor_msgs::msg::dds_::JointState_`.
fn ros_type(dds_type: &str) -> Option<String> {
    let (folder, name) = dds_type.split_once("::dds_::")?;
    Some(format!(
        "{}/{}",
        folder.replace("::", "/"),
        name.strip_suffix('_')?
    ))
}

#[cfg(test)]
mod tests {
    use tauscope_archive::ros::Message as _;

    use super::*;

    #[test]
    fn keys_and_tokens_of_one_publisher_come_together() {
        let mut seen = Publications::default();
        let dds_type = ros::JointState::dds_type();
        seen.announce(&format!(
            "@ros2_lv/3/abc/0/10/MP/%/%/driver/%arm%joint_states/{dds_type}/RIHS01_x/::,7:,:,:,,"
        ));
        seen.announce(&format!(
            "@ros2_lv/3/abc/0/11/MS/%/%/viewer/%arm%joint_states/{dds_type}/RIHS01_x/::,7:,:,:,,"
        ));
        let state = ros::JointState {
            name: vec!["a".to_owned(), "b".to_owned()],
            ..ros::JointState::default()
        };
        let mut body = Vec::new();
        ros::encode(&state, &mut body).unwrap();
        seen.hear(
            &format!("3/arm/joint_states/{dds_type}/RIHS01_x"),
            &body,
            None,
        );
        let (key, found) = seen.by_key.first_key_value().unwrap();
        assert_eq!(key, &format!("3/arm/joint_states/{dds_type}"));
        assert!(found.is_joint_state());
        assert_eq!((found.publishers(), found.heard), (1, 1));
        assert_eq!(found.joints, ["a", "b"]);
        let topic = "/arm/joint_states".to_owned();
        assert_eq!(found.form, Form::Rmw { domain: 3, topic });
    }

    #[test]
    fn a_bridge_announces_its_keys_too() {
        let mut seen = Publications::default();
        seen.announce(
            "@/abc/@ros2_lv/MP/bot1§joint_states/sensor_msgs§msg§JointState/::,10:,:,:,,",
        );
        let (key, found) = seen.by_key.first_key_value().unwrap();
        assert_eq!(key, "bot1/joint_states");
        assert!(found.is_joint_state());
        assert_eq!(found.form, Form::Plain);
    }

    #[test]
    fn keys_without_number_do_not_fill_the_memory() {
        let mut seen = Publications::default();
        for n in 0..1000 {
            seen.hear(&format!("key/{n}"), b"", None);
        }
        assert_eq!(seen.by_key.len(), MAX_KEYS);
        assert_eq!(seen.more, 1000 - MAX_KEYS as u64);
    }
}
