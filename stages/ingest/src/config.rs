//! The source's part of the pipeline file.

mod ur_rtde;

use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use tauscope_bus::ZenohEndpoints;

pub use ur_rtde::{UrEffort, UrRtdeConfig};

/// A source: exactly one of `file`, `csv`, `zenoh`, `ur_rtde` and `simulate`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// A recording: an MCAP file, a rosbag2 folder, an SQLite bag, a bag of ROS 1, or an episode of a LeRobot data
    /// set.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<FileConfig>,
    /// A table, with or without a header line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub csv: Option<CsvConfig>,
    /// Live messages over Zenoh.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zenoh: Option<ZenohConfig>,
    /// Live data of a Universal Robots controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ur_rtde: Option<UrRtdeConfig>,
    /// A simulated cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulate: Option<SimulateConfig>,
    /// Zenoh endpoints at which the running pipeline accepts commands: acknowledge, mute, payload, learn, label. By
    /// default it accepts none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commands: Option<ZenohEndpoints>,
    /// Playback rate of recorded or simulated samples. Has no effect on live messages.
    pub rate: Rate,
    /// Cutoff of the low-pass filter on positions before they are differentiated, if the source gives no velocity
    /// \[Hz\].
    #[schemars(range(min = 0.01, max = 10_000.0))]
    pub velocity_cutoff_hz: f64,
    /// Maximum age, relative to a sample, of the command or the external twin's effort attached to it \[s\].
    #[schemars(range(min = 0.001, max = 3600.0))]
    pub max_age_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            file: None,
            csv: None,
            zenoh: None,
            ur_rtde: None,
            simulate: None,
            commands: None,
            rate: Rate::default(),
            velocity_cutoff_hz: 20.0,
            max_age_s: 0.5,
        }
    }
}

/// A recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FileConfig {
    /// The MCAP file, the folder of a rosbag2 bag or its `.db3`, the `.bag` of ROS 1, or `DATASET/episode_000003` of
    /// a LeRobot data set.
    pub path: PathBuf,
    /// Topics of the messages in the recording.
    #[serde(default)]
    pub topics: Topics,
}

/// ROS 2 topics of one arm. A topic that is not named is not read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Topics {
    /// Measured joint states (`sensor_msgs/msg/JointState` or `control_msgs/msg/DynamicJointState`).
    pub state: String,
    /// Commanded positions, perhaps velocities (`sensor_msgs/msg/JointState`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub command: Option<String>,
    /// Efforts computed by an external twin (`sensor_msgs/msg/JointState`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub twin: Option<String>,
    /// The attached tool (`geometry_msgs/msg/InertiaStamped`); mass 0 when it is detached.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tool: Option<String>,
    /// Requests that the detectors relearn the robot's baseline behaviour (`std_msgs/msg/Bool`, true).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub learn: Option<String>,
    /// Commands in an archive of tauscope (`diagnostic_msgs/msg/DiagnosticArray`), so that a replay applies them as
    /// the live run did. A recording may lack the topic. Live commands arrive at the source's `commands` endpoints
    /// instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commands: Option<String>,
}

impl Default for Topics {
    fn default() -> Self {
        Self {
            state: "/joint_states".to_owned(),
            command: None,
            twin: None,
            tool: None,
            learn: None,
            commands: Some("/commands".to_owned()),
        }
    }
}

/// A table with one row per instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CsvConfig {
    /// The file.
    pub path: PathBuf,
    /// Mapping of the columns to quantities.
    pub columns: tauscope_archive::CsvMapping,
}

/// Live messages over Zenoh. At least one of `connect` and `listen` must be given: multicast discovery
/// is off, so that two cells on one network cannot connect by accident.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ZenohConfig {
    /// Endpoints to connect to, e.g. `tcp/localhost:7447`; retried until they answer.
    pub connect: Vec<String>,
    /// Endpoints to listen on.
    pub listen: Vec<String>,
    /// Key scheme of the publishers.
    pub keys: Keys,
    /// `ROS_DOMAIN_ID` of the publishers, for `rmw_zenoh`.
    #[schemars(range(max = 232))]
    pub domain: u32,
    /// Namespace of the bridge, for `ros2dds`, or prefix of the keys, for `tauscope`; by default the
    /// cell's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub namespace: Option<String>,
    /// The topics.
    pub topics: Topics,
    /// Capacity of the queue of received messages. When it is full, the oldest message is dropped and counted.
    #[schemars(range(min = 1, max = 1_000_000))]
    pub queue: usize,
}

impl Default for ZenohConfig {
    fn default() -> Self {
        Self {
            connect: Vec::new(),
            listen: Vec::new(),
            keys: Keys::default(),
            domain: 0,
            namespace: None,
            topics: Topics::default(),
            queue: 1024,
        }
    }
}

/// Key schemes of publishers on Zenoh.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Keys {
    /// ROS 2 nodes with `rmw_zenoh`: `<domain>/<topic>/<type>/<type hash>`.
    #[default]
    RmwZenoh,
    /// ROS 2 nodes behind `zenoh-bridge-ros2dds`: `<namespace>/<topic>`.
    Ros2dds,
    /// Publishers of tauscope itself: `<cell>/<topic>`.
    Tauscope,
}

/// A simulated cell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulateConfig {
    /// The scenario file, as `tauscope simulate` takes it.
    pub scenario: PathBuf,
    /// Name of the recording to play; by default the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recording: Option<String>,
}

/// Playback rate of recorded samples: `realtime`, `fast`, or a factor such as 2.5.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Rate {
    /// The recorded rate.
    #[default]
    Realtime,
    /// As fast as the machine can.
    Fast,
    /// This multiple of the recorded rate.
    Factor(f64),
}

impl Rate {
    /// Returns the seconds of recording per second of real time; `None` for as fast as possible.
    pub fn factor(self) -> Option<f64> {
        match self {
            Self::Realtime => Some(1.0),
            Self::Fast => None,
            Self::Factor(factor) => Some(factor),
        }
    }
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum RateForm {
    Factor(f64),
    Word(String),
}

impl<'de> Deserialize<'de> for Rate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "`realtime`, `fast`, or a factor above 0";
        let form = RateForm::deserialize(deserializer)
            .map_err(|_| serde::de::Error::custom(format!("expected {expected}")))?;
        match form {
            RateForm::Factor(factor) if factor > 0.0 && factor.is_finite() => {
                Ok(Self::Factor(factor))
            }
            RateForm::Word(word) if word == "realtime" => Ok(Self::Realtime),
            RateForm::Word(word) if word == "fast" => Ok(Self::Fast),
            RateForm::Factor(factor) => Err(serde::de::Error::custom(format!(
                "{factor} is no rate: expected {expected}"
            ))),
            RateForm::Word(word) => Err(serde::de::Error::custom(format!(
                "`{word}` is no rate: expected {expected}"
            ))),
        }
    }
}

impl Serialize for Rate {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Realtime => serializer.serialize_str("realtime"),
            Self::Fast => serializer.serialize_str("fast"),
            Self::Factor(factor) => serializer.serialize_f64(*factor),
        }
    }
}

impl JsonSchema for Rate {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Rate".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "`realtime`, `fast` (as fast as the machine can), or a factor such as 2.5.",
            "anyOf": [
                {"enum": ["realtime", "fast"]},
                {"type": "number", "exclusiveMinimum": 0},
            ],
        })
    }
}

/// Errors in the configuration of a source.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// A number of sources other than one.
    #[error(
        "an ingest stage has exactly one of `file`, `csv`, `zenoh`, `ur_rtde` and `simulate`, found {found}"
    )]
    OneSource {
        /// Number of sources given.
        found: usize,
    },
    /// A Zenoh source without endpoints.
    #[error("`zenoh` needs at least one endpoint in `connect` or `listen`")]
    NoEndpoint,
    /// A number of joints other than the six of a Universal Robots arm.
    #[error(
        "`ur_rtde` reads six joints, found {found}: name them from base to wrist, `joints: [shoulder_pan_joint, ...]`"
    )]
    UrJoints {
        /// Number of joints.
        found: usize,
    },
    /// A joint of the cell that `joints` of `ur_rtde` does not name.
    #[error("`joints` of `ur_rtde` does not name joint `{joint}` of the robot")]
    UrJointUnnamed {
        /// The joint.
        joint: String,
    },
    /// A payload without a link to attach it to.
    #[error("`payload: true` needs a `tool` of the cell with the `link` that is the flange")]
    UrPayload,
    /// An endpoint or key that Zenoh rejects.
    #[error("zenoh does not take {what} `{text}`: {reason}")]
    Zenoh {
        /// Endpoint or key.
        what: &'static str,
        /// Text of the endpoint or key.
        text: String,
        /// Reason given by Zenoh.
        reason: String,
    },
    /// More joints than a sample holds.
    #[error("{found} joints, at most {limit} are supported")]
    TooManyJoints {
        /// Number of joints.
        found: usize,
        /// Maximum number of joints.
        limit: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(yaml: &str) -> Result<Config, String> {
        serde_saphyr::from_str(yaml).map_err(|error| error.to_string())
    }

    #[test]
    fn one_source_and_a_rate() {
        let config =
            parse("{file: {path: a.mcap, topics: {command: /joint_commands}}, rate: 2.5}").unwrap();
        assert_eq!(config.rate, Rate::Factor(2.5));
        assert_eq!(config.source().map(|(name, _)| name), Ok("file"));
        let file = config.file.unwrap();
        assert_eq!(file.topics.state, "/joint_states");
        assert_eq!(file.topics.command.as_deref(), Some("/joint_commands"));
        assert_eq!(
            parse("{file: {path: a}, rate: fast}").unwrap().rate,
            Rate::Fast
        );
    }

    #[test]
    fn no_source_or_two_are_refused() {
        let none = parse("{rate: realtime}").unwrap();
        assert_eq!(
            none.source().map(|_| ()).unwrap_err(),
            ConfigError::OneSource { found: 0 }
        );
        let two = parse("{file: {path: a}, zenoh: {}}").unwrap();
        assert_eq!(
            two.source().map(|_| ()).unwrap_err(),
            ConfigError::OneSource { found: 2 }
        );
    }

    #[test]
    fn a_rate_that_is_none_says_what_would_be_one() {
        for text in ["{rate: 0}", "{rate: slow}", "{rate: -1}", "{rate: [1]}"] {
            let error = parse(text).unwrap_err();
            assert!(
                error.contains("`realtime`, `fast`, or a factor above 0"),
                "{text}: {error}"
            );
        }
    }

    #[test]
    fn unknown_keys_are_refused() {
        assert!(
            parse("{file: {path: a, topic: /x}}")
                .unwrap_err()
                .contains("topic")
        );
    }
}
