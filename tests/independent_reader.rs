//! An archive of ours, read by the reference reader from PyPI, must hold our numbers.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::python;
use crate::common::{Out, bundled, root, skipped, tauscope, write};
use tauscope_archive::{Recording, ros};

const PACKAGES: [&str; 2] = ["mcap==1.6.0", "mcap-ros2-support==0.6.0"];

/// Content of a topic, as read by our own reader.
#[derive(Default)]
struct Topic {
    count: u64,
    effort_sum: BTreeMap<String, f64>,
}

fn read_ourselves(path: &Path) -> BTreeMap<String, Topic> {
    let mut topics: BTreeMap<String, Topic> = BTreeMap::new();
    let recording = Recording::open(path).unwrap();
    let mut messages = recording.all_messages().unwrap();
    while let Some(message) = messages.next_message() {
        let message = message.unwrap();
        let topic = topics.entry(message.topic.name.clone()).or_default();
        topic.count += 1;
        if let Ok(state) = message.decode::<ros::JointState>() {
            for (name, effort) in state.name.iter().zip(&state.effort) {
                *topic.effort_sum.entry(name.clone()).or_default() += effort;
            }
        }
    }
    topics
}

/// Replays the bundled recording into `folder`; returns the archive.
fn replayed(folder: &Path) -> PathBuf {
    let data = bundled();
    let pipeline = write(
        &folder.join("pipeline.yaml"),
        &format!(
            "version: 1\ncells: {{demo: {{robot: {}}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {}}}}}}}\n\
             - {{name: twin, input: ingest, twin: {{model: {}}}}}\n\
             - {{name: detect, input: twin, detect: {{twin_regression: {{}}}}}}\n\
             - {{name: record, inputs: [ingest, twin, detect], record: {{mcap: x.mcap}}}}\n",
            data.join("demo_arm.urdf").display(),
            data.join("demo.mcap").display(),
            data.join("demo.twin.yaml").display(),
        ),
    );
    let mut replay = tauscope();
    replay
        .arg("replay")
        .arg("--pipeline")
        .arg(pipeline)
        .arg(data.join("demo.mcap"));
    replay.arg("--out").arg(folder);
    let replayed = Out::of(replay);
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    folder.join("demo.mcap")
}

#[test]
fn the_reference_reader_finds_our_numbers() {
    let python = match python::python("python-independent-reader", &PACKAGES, "mcap, mcap_ros2") {
        Ok(python) => python,
        Err(why) => return skipped("the_reference_reader_finds_our_numbers", &why),
    };
    let folder = tempfile::tempdir().unwrap();
    let archive = replayed(folder.path());
    let mut reader = Command::new(python);
    reader
        .arg(root().join("tests/python/read_archive.py"))
        .arg(&archive);
    let read = Out::of(reader);
    assert_eq!(read.code, 0, "{}", read.stderr);
    let theirs: serde_json::Value = serde_json::from_str(&read.stdout).unwrap();

    assert_eq!(theirs["profile"], "ros2");
    assert_eq!(
        theirs["metadata"]["tauscope"]["tauscope"],
        env!("CARGO_PKG_VERSION")
    );
    for hash in [
        "pipeline_sha256",
        "cells/demo/urdf_sha256",
        "stages/twin/twin_sha256",
    ] {
        assert_eq!(
            theirs["metadata"]["tauscope"][hash].as_str().map(str::len),
            Some(64),
            "{hash}"
        );
    }
    let ours = read_ourselves(&archive);
    let their_topics = theirs["topics"].as_object().unwrap();
    assert_eq!(
        their_topics.keys().collect::<Vec<_>>(),
        ours.keys().collect::<Vec<_>>()
    );
    for topic in [
        "/joint_states",
        "/twin/joint_states",
        "/residual",
        "/detections",
    ] {
        assert!(ours.contains_key(topic), "no {topic}");
    }
    for (name, topic) in &ours {
        assert_eq!(their_topics[name]["count"], topic.count, "{name}");
        assert_eq!(their_topics[name]["encoding"], "ros2msg", "{name}");
        for (joint, sum) in &topic.effort_sum {
            let their_sum = their_topics[name]["effort_sum"][joint].as_f64().unwrap();
            assert!(
                (their_sum - sum).abs() <= 1e-12 * sum.abs(),
                "{name} {joint}"
            );
        }
    }
    // A twin's effort for every joint state, and a residual after the filters have settled.
    assert_eq!(
        ours["/twin/joint_states"].count,
        ours["/joint_states"].count
    );
    assert!(ours["/residual"].count > ours["/joint_states"].count - 100);
}
