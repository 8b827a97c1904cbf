//! Keys of the subscribed topics.

use std::collections::BTreeSet;

use tauscope_archive::ros::JointStateType;

use crate::config::{Keys, ZenohConfig};

/// Maximum number of hashes that are warned of, each once.
/// Resolution: memory; further hashes are not warned of.
const MAX_WARNED: usize = 16;

/// Mapping of topic names to keys.
#[derive(Debug, Clone)]
pub(super) struct KeyScheme {
    pub keys: Keys,
    pub domain: u32,
    pub prefix: String,
}

impl KeyScheme {
    pub fn new(config: &ZenohConfig, cell: &str) -> Self {
        let prefix = config.namespace.as_deref().unwrap_or(cell);
        Self {
            keys: config.keys,
            domain: config.domain,
            prefix: prefix.trim_matches('/').to_owned(),
        }
    }

    /// Returns the key expression of a topic whose messages have this DDS type. It matches any hash of the
    /// type: messages of another version are better read with a warning than missed silently.
    pub fn key(&self, topic: &str, dds_type: &str) -> String {
        let stem = self.stem(topic, dds_type);
        match self.keys {
            Keys::RmwZenoh => format!("{stem}/*"),
            Keys::Ros2dds | Keys::Tauscope => stem,
        }
    }

    /// Returns the key expressions of a topic of joint states of any type, each with the type if the key contains it.
    pub fn joint_state_keys(&self, topic: &str) -> Vec<(String, Option<JointStateType>)> {
        let typed = |of: JointStateType| (self.key(topic, &of.dds_type()), Some(of));
        match self.keys {
            Keys::RmwZenoh => JointStateType::ALL.map(typed).to_vec(),
            Keys::Ros2dds | Keys::Tauscope => vec![(self.key(topic, ""), None)],
        }
    }

    /// Returns the key expression without the type's hash.
    pub fn stem(&self, topic: &str, dds_type: &str) -> String {
        let topic = topic.trim_matches('/');
        match self.keys {
            Keys::RmwZenoh => format!("{}/{topic}/{dds_type}", self.domain),
            Keys::Ros2dds | Keys::Tauscope if self.prefix.is_empty() => topic.to_owned(),
            Keys::Ros2dds | Keys::Tauscope => format!("{}/{topic}", self.prefix),
        }
    }
}

/// Warns of publishers whose message type has another hash than ours.
#[derive(Debug)]
pub(super) struct HashWatch {
    /// Whether keys end with a hash.
    active: bool,
    warned: BTreeSet<String>,
}

impl HashWatch {
    pub fn new(scheme: &KeyScheme) -> Self {
        Self {
            active: scheme.keys == Keys::RmwZenoh,
            warned: BTreeSet::new(),
        }
    }

    /// Compares the hash at the end of `key` with `expected`; returns whether it warned.
    pub fn compare(&mut self, key: &str, expected: &str) -> bool {
        if !self.active {
            return false;
        }
        let found = key.rsplit('/').next().unwrap_or_default();
        if found == expected || self.warned.len() >= MAX_WARNED || self.warned.contains(found) {
            return false;
        }
        tracing::warn!(
            "{key}: the publisher's message type has the hash {found}, ours {expected}: its fields may \
             differ"
        );
        self.warned.insert(found.to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scheme(keys: Keys, namespace: Option<&str>) -> KeyScheme {
        let namespace = namespace.map(str::to_owned);
        let config = ZenohConfig {
            keys,
            namespace,
            domain: 3,
            ..ZenohConfig::default()
        };
        KeyScheme::new(&config, "demo")
    }

    #[test]
    fn each_publisher_has_its_keys() {
        let joint_state = "sensor_msgs::msg::dds_::JointState_";
        assert_eq!(
            scheme(Keys::RmwZenoh, None).key("/arm/joint_states", joint_state),
            "3/arm/joint_states/sensor_msgs::msg::dds_::JointState_/*"
        );
        let bridge = scheme(Keys::Ros2dds, Some("/bot1/"));
        assert_eq!(
            bridge.key("/joint_states", joint_state),
            "bot1/joint_states"
        );
        let bare = scheme(Keys::Ros2dds, Some("/"));
        assert_eq!(bare.key("/joint_states", joint_state), "joint_states");
        let own = scheme(Keys::Tauscope, None);
        assert_eq!(own.key("/joint_states", joint_state), "demo/joint_states");
    }

    #[test]
    fn another_hash_is_warned_of_once() {
        let mut watch = HashWatch::new(&scheme(Keys::RmwZenoh, None));
        assert!(!watch.compare("0/joint_states/T/RIHS01_aa", "RIHS01_aa"));
        assert!(watch.compare("0/joint_states/T/RIHS01_bb", "RIHS01_aa"));
        assert!(!watch.compare("0/joint_states/T/RIHS01_bb", "RIHS01_aa"));
        assert!(!HashWatch::new(&scheme(Keys::Tauscope, None)).compare("demo/joint_states", "x"));
    }
}
