//! Replay of the bundled recording: its contacts, reproducibility, and replay of older archives.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::common::{Out, bundled, tauscope, write};

/// A pipeline over the bundled recording with these detectors, its results in `folder`.
fn pipeline(folder: &Path, detectors: &[&str]) -> PathBuf {
    let data = bundled();
    let mut text = format!(
        "version: 1\ncells: {{demo: {{robot: {robot}}}}}\nstages:\n\
         - {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: fast}}}}\n\
         - {{name: twin, input: ingest, twin: {{model: {model}}}}}\n",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
        model = data.join("demo.twin.yaml").display(),
    );
    for detector in detectors {
        text += &format!("- {{name: {detector}, input: twin, detect: {{{detector}: {{}}}}}}\n");
    }
    let inputs = [&["ingest", "twin"], detectors].concat().join(", ");
    text += &format!("- {{name: record, inputs: [{inputs}], record: {{mcap: run.mcap}}}}\n");
    write(&folder.join("pipeline.yaml"), &text)
}

/// Events of the first recording's detector from `tauscope replay --json`.
fn events(out: &Out, detector: &str) -> Vec<serde_json::Value> {
    let summary: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let detectors = summary[0]["detectors"].as_array().unwrap();
    let found = detectors
        .iter()
        .find(|d| d["detector"] == detector)
        .unwrap();
    found["events"].as_array().unwrap().clone()
}

fn replay(pipeline: &Path, recording: &Path, out: &Path, more: &[&str]) -> Out {
    let pipeline = [
        "replay".as_ref(),
        "--force".as_ref(),
        "--json".as_ref(),
        "--pipeline".as_ref(),
        pipeline.as_os_str(),
    ];
    let recording = [recording.as_os_str(), "--out".as_ref(), out.as_os_str()];
    let arguments = pipeline.into_iter().chain(recording);
    Out::answer(arguments.chain(more.iter().map(OsStr::new)))
}

#[test]
fn every_contact_of_the_bundled_recording_is_found_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let file = pipeline(folder.path(), &["twin_regression"]);
    let out = replay(&file, &bundled().join("demo.mcap"), folder.path(), &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let labels = std::fs::read_to_string(bundled().join("labels.json")).unwrap();
    let labels: serde_json::Value = serde_json::from_str(&labels).unwrap();
    let labels = labels["recordings"]["demo"]["events"].as_array().unwrap();
    let events = events(&out, "twin_regression");
    let belongs = |event: &serde_json::Value, label: &serde_json::Value| {
        let (t, from) = (
            event["t"].as_f64().unwrap(),
            label["t_on"].as_f64().unwrap(),
        );
        (from..=label["t_off"].as_f64().unwrap() + 0.15).contains(&t)
    };
    assert!(labels.len() >= 5);
    for label in labels {
        assert!(
            events.iter().any(|event| belongs(event, label)),
            "missed {label}"
        );
    }
    for event in &events {
        assert!(
            labels.iter().any(|label| belongs(event, label)),
            "false alarm {event}"
        );
    }
}

#[test]
fn a_contact_free_recording_raises_no_alarm() {
    let folder = tempfile::tempdir().unwrap();
    let file = pipeline(folder.path(), &["twin_regression"]);
    let out = replay(
        &file,
        &bundled().join("demo_train_points.mcap"),
        folder.path(),
        &[],
    );
    assert_eq!(out.code, 0, "{}", out.stderr);
    assert_eq!(
        events(&out, "twin_regression"),
        Vec::<serde_json::Value>::new()
    );
}

#[test]
fn replays_give_the_same_bytes_also_if_no_core_is_left_to_read_ahead() {
    let folder = tempfile::tempdir().unwrap();
    let file = pipeline(folder.path(), &["twin_regression", "naive_difference"]);
    let read = |out: &str, more: &[&str]| {
        let out = folder.path().join(out);
        let done = replay(&file, &bundled().join("demo.mcap"), &out, more);
        assert_eq!(done.code, 0, "{}", done.stderr);
        ["demo.mcap", "summary.parquet", "events.parquet"]
            .map(|name| std::fs::read(out.join(name)).unwrap())
    };
    let first = read("first", &[]);
    assert!(first == read("second", &[]));
    assert!(first == read("alone", &["--jobs", "256"]));
}

#[test]
fn the_live_run_finds_what_the_replay_finds() {
    let folder = tempfile::tempdir().unwrap();
    let file = pipeline(folder.path(), &["twin_regression"]);
    let replayed = replay(
        &file,
        &bundled().join("demo.mcap"),
        &folder.path().join("r"),
        &[],
    );
    let mut command = tauscope();
    command.arg("run").arg(&file);
    let run = Out::of(command);
    assert_eq!(
        run.code, 0,
        "nothing may be lost:\n{}{}",
        run.stdout, run.stderr
    );
    // The run's archive without its detections: replaying it must give the same.
    let again = replay(
        &file,
        &folder.path().join("run.mcap"),
        &folder.path().join("a"),
        &[],
    );
    assert_eq!(
        events(&again, "twin_regression"),
        events(&replayed, "twin_regression")
    );
    // The detections recorded by the run equal those recorded by the replay.
    let detections = |path: PathBuf| {
        let recording = tauscope_archive::Recording::open(&path).unwrap();
        let mut messages = recording.messages(&["/detections"]).unwrap();
        let mut all = Vec::new();
        while let Some(message) = messages.next_message() {
            all.push(message.unwrap().body.to_vec());
        }
        all
    };
    let replayed = detections(folder.path().join("r/demo.mcap"));
    assert!(!replayed.is_empty());
    assert_eq!(detections(folder.path().join("run.mcap")), replayed);
}

#[test]
fn a_new_detector_goes_through_an_old_archive_with_the_twin_kept_or_computed_anew() {
    let folder = tempfile::tempdir().unwrap();
    let old = pipeline(folder.path(), &["twin_regression"]);
    let first = replay(
        &old,
        &bundled().join("demo.mcap"),
        &folder.path().join("old"),
        &[],
    );
    assert_eq!(first.code, 0, "{}", first.stderr);
    let archive = folder.path().join("old/demo.mcap");
    let new = pipeline(folder.path(), &["twin_regression", "naive_difference"]);
    for twin in ["recompute", "keep"] {
        let out = folder.path().join(twin);
        let again = replay(&new, &archive, &out, &["--twin", twin]);
        assert_eq!(again.code, 0, "{}", again.stderr);
        assert!(out.join("demo.mcap").exists());
        // The new detector has judged it, and the old one gives the same result.
        events(&again, "naive_difference");
        let onsets = |out: &Out| -> Vec<f64> {
            events(out, "twin_regression")
                .iter()
                .map(|e| e["t"].as_f64().unwrap())
                .collect()
        };
        assert_eq!(onsets(&again), onsets(&first), "--twin {twin}");
    }
}

#[test]
fn a_replay_never_overwrites_what_it_reads() {
    let folder = tempfile::tempdir().unwrap();
    let file = pipeline(folder.path(), &["twin_regression"]);
    let copy = folder.path().join("demo.mcap");
    std::fs::copy(bundled().join("demo.mcap"), &copy).unwrap();
    let out = replay(&file, &copy, folder.path(), &[]);
    assert_eq!(out.code, 2);
    assert!(out.stderr.contains("would overwrite"), "{}", out.stderr);
}
