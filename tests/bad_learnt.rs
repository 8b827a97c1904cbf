//! Trained parameters for another robot, for other joints or at another rate: refused by every command that would use
//! them, with the place and the remedy.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::{Path, PathBuf};

use crate::common::labelled_set::{Set, changed, evaluate};
use crate::common::learnt_pipeline::{arm, demo, pipeline, refused, replay, run};
use crate::common::{Out, bundled, tauscope, write};
use serde_json::Value;

/// Checks that `check`, `replay` and `run` refuse the pipeline.
fn refused_by_all(pipeline: &Path, recording: &Path, said: &[&str]) {
    let mut check = tauscope();
    check.arg("check").arg(pipeline);
    refused(&Out::of(check), said);
    let folder = pipeline.parent().unwrap();
    refused(&replay(pipeline, recording, &folder.join("replayed")), said);
    refused(&run(pipeline), said);
}

#[test]
fn what_was_learnt_of_other_joints_is_refused_by_everything_that_would_use_it() {
    let folder = tempfile::tempdir().unwrap();
    let names = std::fs::read_to_string(arm()).unwrap();
    let robot = write(
        &folder.path().join("other.urdf"),
        &names.replace("\"joint2\"", "\"elbow\""),
    );
    let recording = changed(folder.path(), "demo.mcap", |_, state| {
        for name in &mut state.name {
            *name = name.replace("joint2", "elbow");
        }
        true
    });
    let file = pipeline(&robot, &recording, Some("{}")).write(folder.path(), str::to_owned);
    let was = "joint1, joint2, joint3, joint4, joint5, joint6, joint7";
    let said = [
        &format!(
            "`model` of window_ocsvm was trained for the joints {was}, but the cell has joint1, elbow"
        ),
        &format!("what tauscope has learnt is of the joints {was}, but the cell has joint1, elbow"),
        &format!("`bias` of virtual_collision_sensor is of the joints {was}, but"),
        &format!("`bias` of virtual_collision_sensor_basic is of the joints {was}, but"),
        "pipeline.yaml:",
    ];
    refused_by_all(&file, &recording, &said.map(|s| -> &str { s }));
}

#[test]
fn what_was_learnt_of_fewer_joints_or_in_another_order_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (arm, demo) = (arm(), demo());
    let turned = |line: &str| match line.trim() {
        "name: joint1" | "- name: joint1" => line.replace("joint1", "joint2"),
        "name: joint2" | "- name: joint2" => line.replace("joint2", "joint1"),
        _ => line.to_owned(),
    };
    let file = pipeline(&arm, &demo, None).write(folder.path(), turned);
    let said = "what tauscope has learnt is of the joints joint2, joint1, joint3";
    refused_by_all(&file, &demo, &[said]);

    let fewer = |line: &str| line.replace("joint7: ", "# joint7: ");
    let file = pipeline(&arm, &demo, None).write(folder.path(), fewer);
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("# joint7"));
    refused_by_all(
        &file,
        &demo,
        &[
            "virtual_collision_sensor_basic is of the joints joint1, joint2, joint3, joint4, joint5, joint6, but",
        ],
    );
}

/// Every second sample: 50 instead of 100 per second.
fn slow(folder: &Path) -> PathBuf {
    changed(folder, "demo.mcap", |row, _| row % 2 == 0)
}

#[test]
fn what_was_learnt_at_another_rate_ends_a_replay_and_a_run_and_is_not_started_again() {
    let folder = tempfile::tempdir().unwrap();
    let (arm, slow) = (arm(), slow(folder.path()));
    let file = pipeline(&arm, &slow, None).write(folder.path(), str::to_owned);
    let said = "it has learnt from 100.0 samples a second, and here are 50.0: let `tauscope init` or `tauscope evaluate` learn";
    let replayed = replay(&file, &slow, &folder.path().join("replayed"));
    assert_eq!(replayed.code, 1, "{}", replayed.stderr);
    assert!(replayed.stderr.contains(said), "{}", replayed.stderr);

    let live = run(&file);
    assert_eq!(live.code, 1, "{}", live.stderr);
    assert!(live.stderr.contains(said), "{}", live.stderr);
    let summary: Value = serde_json::from_str(&live.stdout).unwrap();
    let stages = summary["stages"].as_array().unwrap();
    let tauscope = stages
        .iter()
        .find(|stage| stage["stage"] == "tauscope")
        .unwrap();
    assert_eq!(tauscope["restarts"], 0);
    assert_eq!(tauscope["failed"], true);
    // The sources may have been ended before they had emitted everything.
    let twin = stages
        .iter()
        .find(|stage| stage["stage"] == "twin")
        .unwrap();
    let taken = tauscope["received"].as_u64().unwrap() + tauscope["dropped"].as_u64().unwrap();
    assert_eq!(
        Some(taken),
        twin["emitted"].as_u64(),
        "what it did not live to see is lost: {tauscope}"
    );
}

/// A set whose test recording has half the rate of the training recordings.
fn of_two_rates(folder: &Path) -> PathBuf {
    let set = Set {
        test: slow(folder),
        ..Set::default()
    };
    set.write(folder)
}

#[test]
fn who_was_asked_for_and_cannot_do_with_a_set_of_two_rates_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let set = of_two_rates(folder.path());
    let asked = evaluate(
        &set,
        &folder.path().join("one"),
        &["--detectors", "tauscope"],
    );
    assert_eq!(asked.code, 1, "{}", asked.stderr);
    let said = "tauscope: it has learnt from 100.0 samples a second, and here are 50.0";
    assert_eq!(asked.stderr.matches(said).count(), 1, "{}", asked.stderr);
    assert!(asked.stderr.contains("demo.mcap"), "{}", asked.stderr);
}

#[test]
#[ignore = "takes three minutes: all nets are trained"]
fn who_was_not_asked_for_and_cannot_do_with_a_set_of_two_rates_is_left_out_and_noted() {
    let folder = tempfile::tempdir().unwrap();
    let set = of_two_rates(folder.path());
    let unasked = evaluate(&set, &folder.path().join("all"), &["--json"]);
    assert_eq!(unasked.code, 0, "{}", unasked.stderr);
    let summary: Value = serde_json::from_str(&unasked.stdout).unwrap();
    let detectors = summary["detectors"].as_array().unwrap();
    let names: Vec<&str> = (detectors.iter())
        .filter_map(|detector| detector["detector"].as_str())
        .collect();
    assert!(names.contains(&"twin_regression"), "{names:?}");
    let notes = summary["notes"].as_array().unwrap();
    for left_out in ["tauscope", "window_ocsvm", "lstm_momentum_observer"] {
        assert!(!names.contains(&left_out), "{names:?}");
        let of_it = notes.iter().filter_map(|note| note.as_str()).any(|note| {
            note.contains(left_out) && note.contains("100.0 samples a second, and here are 50.0")
        });
        assert!(of_it, "{left_out}: {notes:?}");
    }
}

#[test]
fn a_twin_of_another_robot_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(bundled().join("demo.twin.yaml")).unwrap();
    let other = text.replace("name: demo_arm", "name: other_arm");
    let other = write(&folder.path().join("other.yaml"), &other);
    let said = [
        "this twin was made for the robot `other_arm`, not for `demo_arm`",
        "tauscope calibrate",
    ];
    let set = Set::default().write(folder.path());
    let more = [
        "--detectors",
        "naive_difference",
        "--twin",
        other.to_str().unwrap(),
    ];
    refused(&evaluate(&set, &folder.path().join("out"), &more), &said);
    let twin = format!("{{model: {}}}", other.display());
    let (arm, demo) = (arm(), demo());
    let file = pipeline(&arm, &demo, Some(&twin)).write(folder.path(), str::to_owned);
    refused_by_all(&file, &demo, &said);
}

#[test]
fn joints_that_a_twin_does_not_know_are_said_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(bundled().join("demo.twin.yaml")).unwrap();
    let other = text.replace("joint3:", "wrist:");
    let other = write(&folder.path().join("other.yaml"), &other);
    let twin = format!("{{model: {}}}", other.display());
    let (arm, demo) = (arm(), demo());
    let file = pipeline(&arm, &demo, Some(&twin)).write(folder.path(), str::to_owned);
    let out = run(&file);
    refused(
        &out,
        &["the twin corrects joint `wrist`, which the robot does not have"],
    );
    assert!(
        out.stderr.contains("1 error; nothing was started"),
        "{}",
        out.stderr
    );
}
