//! The summary of a recording.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::fs;

use crate::common::{PERIOD_NS, START_NS, state, write};
use tauscope_archive::ros::JointState;
use tauscope_archive::{Compression, Info, McapWriter, Recording};

#[test]
fn a_recording_is_described() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let provenance = BTreeMap::from([("version".to_owned(), "1.2".to_owned())]);
    let mut writer = McapWriter::create(&path, Compression::Zstd, &provenance).unwrap();
    let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
    let mut ns = START_NS;
    for i in 0..100 {
        // Half a second is missing before the 50th.
        ns += if i == 50 { 500_000_000 } else { PERIOD_NS };
        writer.write(topic, ns, ns, &state(i)).unwrap();
    }
    writer.finish().unwrap();
    let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
    assert_eq!(info.message_count, 100);
    assert!((info.duration_s - 1.48).abs() < 1e-9);
    let [topic] = info.topics.as_slice() else {
        panic!("{:?}", info.topics);
    };
    assert!((topic.rate_hz.unwrap() - 99.0 / 1.48).abs() < 1e-6);
    let [gap] = topic.gaps.as_slice() else {
        panic!("{:?}", topic.gaps);
    };
    assert!((gap.at_s - 0.49).abs() < 1e-9 && (gap.duration_s - 0.5).abs() < 1e-9);
    let text = info.to_string();
    let after_path = text.split_once("a.mcap: ").unwrap().1;
    let size = fs::metadata(&path).unwrap().len();
    assert_eq!(
        after_path,
        format!(
            "MCAP file, {size} bytes, 100 messages in 1.480 s\n\
             from 1700000000.010000000 s to 1700000001.490000000 s\n\
             /joint_states: 100 x sensor_msgs/msg/JointState, 66.9 Hz\n  \
             joints a, b with position, effort; NaN in 100 messages\n  \
             \
             a gap of 0.500 s at 0.490 s\n\
             made by: version: 1.2\n"
        )
    );
}

#[test]
fn damage_is_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 50);
    let mut bytes = fs::read(&path).unwrap();
    // A chunk in the middle is broken, which only reading finds.
    let chunk = mcap::Summary::read(&bytes).unwrap().unwrap().chunk_indexes[2].clone();
    let at = (chunk.chunk_start_offset + chunk.chunk_length / 2) as usize;
    bytes[at] ^= 0xff;
    fs::write(&path, bytes).unwrap();
    let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
    assert!(info.has_lost_data());
    assert_eq!(info.message_count, 44);
    assert!(info.to_string().contains("damage: "));
    let json = serde_json::to_value(&info).unwrap();
    assert_eq!(json["damage"][0]["damage"], "chunk");
    assert_eq!(json["topics"][0]["name"], "/joint_states");
}
