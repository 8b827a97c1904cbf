//! Messages in other encodings than CDR, and messages whose arrays do not fit.

#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;

use proptest::prelude::*;
use tauscope_archive::ros::{self, Bool, JointState, JointStateType};
use tauscope_archive::{ArchiveError, Info, Recording, RecordingKind};

use crate::common::{mcap_of, state};

const ROS1: [&str; 3] = ["sensor_msgs/JointState", "ros1msg", "ros1"];

/// A joint state in the encoding of ROS 1.
fn ros1(state: &JointState) -> Vec<u8> {
    let mut body = vec![9, 0, 0, 0];
    let text = |body: &mut Vec<u8>, text: &str| {
        body.extend((text.len() as u32).to_le_bytes());
        body.extend(text.as_bytes());
    };
    body.extend(state.header.stamp.sec.to_le_bytes());
    body.extend(state.header.stamp.nanosec.to_le_bytes());
    text(&mut body, &state.header.frame_id);
    body.extend((state.name.len() as u32).to_le_bytes());
    for name in &state.name {
        text(&mut body, name);
    }
    for values in [&state.position, &state.velocity, &state.effort] {
        body.extend((values.len() as u32).to_le_bytes());
        body.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    body
}

fn cdr(state: &JointState) -> Vec<u8> {
    let mut body = Vec::new();
    ros::encode(state, &mut body).unwrap();
    body
}

fn assert_is_read(path: &Path, count: i64) {
    let recording = Recording::open(path).unwrap();
    let topic = &recording.topics()[0];
    assert_eq!(topic.joint_state_type(), Some(JointStateType::JointState));
    assert_eq!(topic.unreadable_joint_states(), None);
    let mut states = recording.joint_states("/joint_states").unwrap();
    for i in 0..count {
        let read = states.next_state().unwrap().unwrap().message;
        assert_eq!(read.header, state(i).header);
        assert_eq!(read.name, state(i).name);
        assert_eq!(read.position, state(i).position);
    }
    assert!(states.next_state().is_none());
}

#[test]
fn ros1_messages_in_mcap_are_joint_states() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let bodies: Vec<_> = (0..20).map(|i| ros1(&state(i))).collect();
    mcap_of(&path, ROS1, &bodies);
    assert_is_read(&path, 20);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.kind(), RecordingKind::Mcap);
    let topic = recording.topic_of::<JointState>("/joint_states").unwrap();
    assert_eq!(topic.type_name, JointStateType::JointState.name());
    assert_eq!(
        topic.type_hash.as_deref(),
        Some(JointStateType::JointState.hash())
    );
    // As part of a bag, and compressed.
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).unwrap();
    let packed: Vec<_> = bodies
        .iter()
        .map(|body| zstd::bulk::compress(body, 0).unwrap())
        .collect();
    mcap_of(&bag.join("bag_0.mcap"), ROS1, &packed);
    assert_is_read(&bag, 20);
}

#[test]
fn ros1_flags_in_mcap_are_flags() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    mcap_of(
        &path,
        ["std_msgs/Bool", "ros1msg", "ros1"],
        &[vec![1], vec![0], vec![1, 2]],
    );
    let recording = Recording::open(&path).unwrap();
    recording.topic_of::<Bool>("/joint_states").unwrap();
    let mut messages = recording.all_messages().unwrap();
    let mut flags = Vec::new();
    while let Some(message) = messages.next_message() {
        flags.push(
            message
                .unwrap()
                .decode::<Bool>()
                .map_err(|error| error.to_string()),
        );
    }
    assert_eq!(
        flags[..2],
        [Ok(Bool { data: true }), Ok(Bool { data: false })]
    );
    let error = flags[2].as_ref().unwrap_err();
    assert!(
        error.ends_with("the 2 bytes are not a std_msgs/msg/Bool in the encoding of ROS 1"),
        "{error}"
    );
}

#[test]
fn type_names_and_schemas_of_other_tools_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let bodies: Vec<_> = (0..5).map(|i| cdr(&state(i))).collect();
    for (name, schema) in [
        ("sensor_msgs/msg/JointState", "ros2idl"),
        ("sensor_msgs/msg/JointState", "ros2msg"),
        ("sensor_msgs/msg/JointState", ""),
        ("sensor_msgs/JointState", "ros2msg"),
        ("sensor_msgs::msg::JointState", "omgidl"),
        ("sensor_msgs::msg::dds_::JointState_", "omgidl"),
    ] {
        mcap_of(&path, [name, schema, "cdr"], &bodies);
        assert_is_read(&path, 5);
    }
}

#[test]
fn joint_states_in_another_encoding_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    for (name, schema, encoding) in [
        ("sensor_msgs/msg/JointState", "jsonschema", "json"),
        ("foxglove.JointStates", "jsonschema", "json"),
        ("foxglove.JointStates", "protobuf", "protobuf"),
        ("sensor_msgs.JointState", "protobuf", "protobuf"),
        ("sensor_msgs/msg/JointState", "ros2msg", "cbor"),
        ("", "", "json"),
    ] {
        mcap_of(
            &path,
            [name, schema, encoding],
            &[br#"{"name": ["a"]}"#.to_vec()],
        );
        let recording = Recording::open(&path).unwrap();
        let error = recording.joint_states("/joint_states").err().unwrap();
        let ArchiveError::UnreadableJointStates { found, .. } = &error else {
            panic!("{error}");
        };
        assert_eq!(
            (found.type_name.as_str(), found.encoding.as_str()),
            (name, encoding)
        );
        assert_eq!(recording.unreadable_joint_states(), [(**found).clone()]);
        let text = error.to_string();
        for part in [
            "topic \"/joint_states\" carries joint states",
            &format!(" as {encoding:?}; only CDR and ros1 messages can be read"),
            "`ros2 bag record`",
        ] {
            assert!(text.contains(part), "{text}");
        }
        let info = Info::read(&recording).unwrap().to_string();
        assert!(info.contains(&found.to_string()), "{info}");
    }
    // No joint states by their name.
    mcap_of(&path, ["foxglove.Log", "protobuf", "protobuf"], &[vec![1]]);
    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.unreadable_joint_states(), []);
    let error = recording.joint_states("/joint_states").err().unwrap();
    assert!(matches!(error, ArchiveError::WrongType { .. }), "{error}");
}

#[test]
fn arrays_that_do_not_fit_are_counted_with_their_lengths() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let names = |count: usize| (0..count).map(|i| format!("j{i}")).collect();
    let of = |named: usize, position: usize| JointState {
        name: names(named),
        position: vec![0.0; position],
        ..state(0)
    };
    let mut states = vec![of(8, 6); 1200];
    for state in &mut states {
        state.effort.clear();
    }
    states.extend([of(0, 6), of(1, 6), of(2, 6), of(3, 6), of(4, 6)]);
    let bodies: Vec<_> = states.iter().map(cdr).collect();
    mcap_of(
        &path,
        ["sensor_msgs/msg/JointState", "ros2msg", "cdr"],
        &bodies,
    );
    let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
    let topic = &info.topics[0];
    assert_eq!(topic.undecodable, 1205);
    let text = info.to_string();
    for line in [
        "  no usable message names a joint\n",
        "  1200 messages cannot be used: `position` has 6 entries for 8 names (j0, j1, j2, j3, j4, j5, j6, j7): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again\n",
        "  1 message cannot be used: `name` is empty, but `position` has 6 entries: their joints are unknown\n",
        "  1 message cannot be used: `position` has 6 entries for 1 name (j0): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again\n",
        "  1 message cannot be used: `position` has 6 entries for 2 names (j0, j1): it is unknown which belongs to which. Make the driver send a value for each name, or only the names that it has values for, and record again\n",
        "  2 messages cannot be used for other reasons\n",
    ] {
        assert!(text.contains(line), "{text}");
    }
    let json = serde_json::to_value(&info).unwrap();
    assert_eq!(json["topics"][0]["undecodable_reasons"][0]["count"], 1200);
}

#[test]
fn names_without_values_are_described() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let named = JointState {
        name: vec!["a".to_owned(), "b".to_owned()],
        ..JointState::default()
    };
    mcap_of(
        &path,
        ["sensor_msgs/msg/JointState", "ros2msg", "cdr"],
        &[cdr(&named)],
    );
    let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
    let text = info.to_string();
    assert!(
        text.contains("joints a, b without position, velocity or effort"),
        "{text}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_ros1_message_makes_it_panic(
        garbage in prop::collection::vec(any::<u8>(), 0..100),
        at in any::<prop::sample::Index>(),
        value: u8,
        cut in any::<prop::sample::Index>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut changed = ros1(&state(3));
        let at = at.index(changed.len());
        changed[at] = value;
        let mut short = changed.clone();
        short.truncate(cut.index(changed.len()));
        mcap_of(&path, ROS1, &[garbage, changed, short]);
        let info = Info::read(&Recording::open(&path).unwrap()).unwrap();
        prop_assert_eq!(info.message_count, 3);
        // Garbage and what is cut short.
        prop_assert!(info.topics[0].undecodable >= 2);
    }
}
