//! Data that rosbag2 expects in an MCAP file and next to it: quality-of-service profiles and the metadata of a bag as
//! YAML (version 9).

use std::path::Path;

use serde::Serialize;
use serde_json::Value;

/// A topic of a bag.
#[derive(Debug, Clone)]
pub(crate) struct BagTopic {
    pub(crate) name: String,
    pub(crate) type_name: String,
    pub(crate) encoding: String,
    pub(crate) type_hash: String,
    /// Quality-of-service profiles in the channel's metadata; `None` for the default profiles.
    pub(crate) offered_qos: Option<String>,
    pub(crate) messages: u64,
}

/// A file of a bag.
#[derive(Debug, Clone)]
pub(crate) struct BagFile {
    name: String,
    log_times_ns: Option<(i64, i64)>,
    /// Number of messages; `None` for the only file of a bag, which contains the messages of all topics.
    messages: Option<u64>,
}

impl BagFile {
    /// Describes the only file of a bag.
    pub(crate) fn new(path: &Path, log_times_ns: Option<(i64, i64)>) -> Self {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Self {
            name: name.into_owned(),
            log_times_ns,
            messages: None,
        }
    }

    /// Sets the number of messages, for one of several files of a bag.
    pub(crate) fn with_messages(mut self, messages: u64) -> Self {
        self.messages = Some(messages);
        self
    }
}

#[derive(Serialize)]
struct Folder<'a> {
    rosbag2_bagfile_information: Information<'a>,
}

#[derive(Serialize)]
struct Information<'a> {
    version: u32,
    storage_identifier: &'a str,
    duration: Duration,
    starting_time: StartingTime,
    message_count: u64,
    topics_with_message_count: Vec<TopicWithCount<'a>>,
    compression_format: &'a str,
    compression_mode: &'a str,
    relative_file_paths: Vec<&'a str>,
    files: Vec<FileInformation<'a>>,
    custom_data: Empty,
    ros_distro: &'a str,
}

#[derive(Serialize, Clone, Copy)]
struct Duration {
    nanoseconds: i64,
}

#[derive(Serialize, Clone, Copy)]
struct StartingTime {
    nanoseconds_since_epoch: i64,
}

#[derive(Serialize)]
struct TopicWithCount<'a> {
    topic_metadata: TopicMetadata<'a>,
    message_count: u64,
}

#[derive(Serialize)]
struct TopicMetadata<'a> {
    name: &'a str,
    r#type: &'a str,
    serialization_format: &'a str,
    offered_qos_profiles: Profiles,
    type_description_hash: &'a str,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Profiles {
    Ours([QosProfile; 1]),
    AsOffered(Value),
}

#[derive(Serialize)]
struct FileInformation<'a> {
    path: &'a str,
    starting_time: StartingTime,
    duration: Duration,
    message_count: u64,
}

#[derive(Serialize)]
struct Empty {}

#[derive(Serialize)]
struct QosProfile {
    history: &'static str,
    depth: u32,
    reliability: &'static str,
    durability: &'static str,
    deadline: Span,
    lifespan: Span,
    liveliness: &'static str,
    liveliness_lease_duration: Span,
    avoid_ros_namespace_conventions: bool,
}

#[derive(Serialize, Clone, Copy)]
struct Span {
    sec: i64,
    nsec: i64,
}

const FOREVER: Span = Span {
    sec: 9_223_372_036,
    nsec: 854_775_807,
};

/// Reliable and volatile, the last ten: what a driver publishes its joint states with.
const QOS: QosProfile = QosProfile {
    history: "keep_last",
    depth: 10,
    reliability: "reliable",
    durability: "volatile",
    deadline: FOREVER,
    lifespan: FOREVER,
    liveliness: "automatic",
    liveliness_lease_duration: FOREVER,
    avoid_ros_namespace_conventions: false,
};

/// The profiles as a channel's metadata has them.
pub(super) fn offered_qos_profiles() -> Result<String, serde_saphyr::SerializeError> {
    serde_saphyr::to_string(&[QOS])
}

/// The metadata of a bag as the record `rosbag2` of its file has it.
pub(crate) fn information(
    topics: &[BagTopic],
    files: &[BagFile],
) -> Result<String, serde_saphyr::SerializeError> {
    serde_saphyr::to_string(&of(topics, files))
}

/// The `metadata.yaml` of a bag.
pub(crate) fn metadata_yaml(
    topics: &[BagTopic],
    files: &[BagFile],
) -> Result<String, serde_saphyr::SerializeError> {
    serde_saphyr::to_string(&Folder {
        rosbag2_bagfile_information: of(topics, files),
    })
}

fn of<'a>(topics: &'a [BagTopic], files: &'a [BagFile]) -> Information<'a> {
    let times = || files.iter().filter_map(|file| file.log_times_ns);
    let start_ns = times().map(|(start_ns, _)| start_ns).min();
    let end_ns = times().map(|(_, end_ns)| end_ns).max();
    let span = |times: Option<(i64, i64)>| {
        let (start_ns, end_ns) = times.unwrap_or((0, 0));
        let duration = Duration {
            nanoseconds: end_ns.saturating_sub(start_ns),
        };
        let starting_time = StartingTime {
            nanoseconds_since_epoch: start_ns,
        };
        (starting_time, duration)
    };
    let (starting_time, duration) = span(start_ns.zip(end_ns));
    let message_count = topics.iter().map(|topic| topic.messages).sum();
    let information = |file: &'a BagFile| {
        let (starting_time, duration) = span(file.log_times_ns);
        FileInformation {
            path: &file.name,
            starting_time,
            duration,
            message_count: file.messages.unwrap_or(message_count),
        }
    };
    let topic = |topic: &'a BagTopic| TopicWithCount {
        topic_metadata: TopicMetadata {
            name: &topic.name,
            r#type: &topic.type_name,
            serialization_format: &topic.encoding,
            offered_qos_profiles: profiles(topic.offered_qos.as_deref()),
            type_description_hash: &topic.type_hash,
        },
        message_count: topic.messages,
    };
    Information {
        version: 9,
        storage_identifier: "mcap",
        duration,
        starting_time,
        message_count,
        topics_with_message_count: topics.iter().map(topic).collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: files.iter().map(|file| file.name.as_str()).collect(),
        files: files.iter().map(information).collect(),
        custom_data: Empty {},
        ros_distro: "unknown",
    }
}

/// The profiles of a channel, where they are a list with a profile in it.
fn profiles(offered: Option<&str>) -> Profiles {
    let read = offered.and_then(|text| serde_saphyr::from_str::<Value>(text).ok());
    match read {
        Some(value) if value.as_array().is_some_and(|list| !list.is_empty()) => {
            Profiles::AsOffered(value)
        }
        _ => Profiles::Ours([QOS]),
    }
}
