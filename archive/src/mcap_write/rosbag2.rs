//! What rosbag2 wants to find in an MCAP file: its quality-of-service profiles, and the metadata of
//! the bag as YAML (version 9).

use std::path::Path;

use serde::Serialize;

use super::WrittenTopic;

#[derive(Serialize)]
struct BagMetadata<'a> {
    version: u32,
    storage_identifier: &'a str,
    duration: Duration,
    starting_time: StartingTime,
    message_count: u64,
    topics_with_message_count: Vec<TopicWithCount<'a>>,
    compression_format: &'a str,
    compression_mode: &'a str,
    relative_file_paths: [&'a str; 1],
    files: [FileInformation<'a>; 1],
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
    offered_qos_profiles: [QosProfile; 1],
    type_description_hash: &'a str,
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

/// The metadata of the bag that consists of this one file.
pub(super) fn serialized_metadata(
    path: &Path,
    topics: &[WrittenTopic],
    log_times_ns: Option<(i64, i64)>,
) -> Result<String, serde_saphyr::SerializeError> {
    let (start_ns, end_ns) = log_times_ns.unwrap_or((0, 0));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let duration = Duration {
        nanoseconds: end_ns - start_ns,
    };
    let starting_time = StartingTime {
        nanoseconds_since_epoch: start_ns,
    };
    let message_count = topics.iter().map(|topic| topic.count).sum();
    let topics = topics.iter().map(|topic| TopicWithCount {
        topic_metadata: TopicMetadata {
            name: &topic.name,
            r#type: topic.type_name,
            serialization_format: "cdr",
            offered_qos_profiles: [QOS],
            type_description_hash: topic.type_hash,
        },
        message_count: topic.count,
    });
    serde_saphyr::to_string(&BagMetadata {
        version: 9,
        storage_identifier: "mcap",
        duration,
        starting_time,
        message_count,
        topics_with_message_count: topics.collect(),
        compression_format: "",
        compression_mode: "",
        relative_file_paths: [&name],
        files: [FileInformation {
            path: &name,
            starting_time,
            duration,
            message_count,
        }],
        custom_data: Empty {},
        ros_distro: "unknown",
    })
}
