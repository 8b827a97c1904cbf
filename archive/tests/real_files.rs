//! Recordings of real arms and of other people's simulators, where they are at hand.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::path::{Path, PathBuf};

use crate::common::shared;
use tauscope_archive::ros::{self, Bool, JointState, Message};
use tauscope_archive::{Info, Recording};

/// All MCAP files in a folder and below.
fn mcap_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(mcap_files(&path));
        } else if path
            .extension()
            .is_some_and(|extension| extension == "mcap")
        {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// Reads every message, in order, and writes it again: the same bytes must come out.
fn check(path: &Path) {
    let recording = Recording::open(path).unwrap();
    assert!(recording.damage().is_empty(), "{}", path.display());
    let mut messages = recording.all_messages().unwrap();
    let mut read = vec![0; recording.topics().len()];
    let mut last_ns = 0;
    let mut body = Vec::new();
    while let Some(message) = messages.next_message() {
        let message = message.unwrap();
        assert!(message.log_time_ns >= last_ns);
        last_ns = message.log_time_ns;
        read[message.topic_index] += 1;
        match message.topic.type_name.as_str() {
            JointState::TYPE => {
                ros::encode(&message.decode::<JointState>().unwrap(), &mut body).unwrap();
                assert_eq!(body, message.body, "{}", path.display());
            }
            Bool::TYPE => {
                ros::encode(&message.decode::<Bool>().unwrap(), &mut body).unwrap();
                assert_eq!(body, message.body, "{}", path.display());
            }
            _ => {}
        }
    }
    let topics = recording.topics().iter();
    assert!(topics.map(|topic| topic.message_count).eq(read));
    assert_eq!(Some(last_ns), recording.end_ns());
}

#[test]
fn real_recordings_are_read_whole() {
    let Some(folder) = shared("real_recordings_are_read_whole", "recordings") else {
        return;
    };
    let files = mcap_files(&folder);
    assert!(files.len() >= 15, "only {} recordings", files.len());
    for path in files {
        check(&path);
    }
}

#[test]
fn simulated_recordings_are_read_whole() {
    let Some(folder) = shared("simulated_recordings_are_read_whole", ".") else {
        return;
    };
    for path in [
        "contacts/assembly/recordings/rec_001.mcap",
        "contacts/cyclic/recordings/rec_001.mcap",
        "contacts/paths/recordings/rec_001.mcap",
        "practice/cases/p01/rec_00.mcap",
    ] {
        check(&folder.join(path));
    }
}

/// Numbers as the Python `mcap` reader gives them.
#[test]
fn a_real_recording_holds_what_others_find() {
    let name = "a_real_recording_holds_what_others_find";
    let Some(path) = shared(name, "recordings/franka-touch/a4.mcap") else {
        return;
    };
    let recording = Recording::open(path).unwrap();
    assert_eq!(recording.start_ns(), Some(1_000_000_000_000));
    assert_eq!(recording.end_ns(), Some(1_015_800_018_361));
    let info = Info::read(&recording).unwrap();
    let topics: Vec<_> = info
        .topics
        .iter()
        .map(|info| (info.topic.name.as_str(), info.topic.message_count))
        .collect();
    assert_eq!(
        topics,
        [
            ("/joint_states", 3148),
            ("/external_torques", 3148),
            ("/contact", 3148)
        ]
    );
    // The torques leave position and velocity empty.
    let joints = info.topics[1].joints.as_ref().unwrap();
    assert_eq!(joints.names.len(), 7);
    assert!(joints.effort && !joints.position && !joints.velocity);
}
