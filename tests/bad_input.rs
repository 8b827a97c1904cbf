//! Damaged recordings and incomplete sets, in `evaluate`, `replay` and `run`: reported as errors, or counted with
//! exit code 3; never silently ignored.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::labelled_set::{Set, changed, evaluate};
use crate::common::learnt_pipeline::{LEARNT, arm, pipeline, refused, replay, run};
use crate::common::{Out, bundled, tauscope, write};
use serde_json::Value;
use tauscope_archive::ros::JointState;

#[test]
fn a_detector_that_needs_kinds_says_which_recordings_have_none() {
    let folder = tempfile::tempdir().unwrap();
    let bare = |folder: &Path, name| changed(folder, name, |_, _| true);
    let set = Set {
        labels: None,
        train: vec![bare(folder.path(), "demo_train_points.mcap")],
        ..Set::default()
    };
    let set = set.write(folder.path());
    let out = folder.path().join("out");
    let run = evaluate(&set, &out, &["--detectors", "contact_classifier"]);
    refused(
        &run,
        &[
            "the training recordings demo_train_points have no labels",
            "`labels`",
        ],
    );
    // A detector that needs no labels runs, and the assumption about them is reported.
    let run = evaluate(&set, &out, &["--detectors", "naive_difference"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let said = "Recordings without labels are treated as free of contacts: demo_train_points";
    assert!(run.stdout.contains(said), "{}", run.stdout);
}

#[test]
fn a_set_with_no_contact_scores_none_of_the_light_detectors_and_says_no_zero() {
    let folder = tempfile::tempdir().unwrap();
    let quiet = changed(folder.path(), "demo_train_points.mcap", |_, _| true);
    let test = folder.path().join("quiet.mcap");
    std::fs::rename(&quiet, &test).unwrap();
    let labels = r#"{"recordings": {"quiet": {"events": []}}}"#;
    let set = Set {
        labels: Some(write(&folder.path().join("own.json"), labels)),
        test,
        ..Set::default()
    };
    let detectors = "naive_difference,twin_regression,momentum_observer,virtual_collision_sensor_basic,\
                     virtual_collision_sensor,tauscope";
    let set = set.write(folder.path());
    let more = ["--json", "--detectors", detectors];
    let run = evaluate(&set, &folder.path().join("out"), &more);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let summary: Value = serde_json::from_str(&run.stdout).unwrap();
    for detector in summary["detectors"].as_array().unwrap() {
        let numbers = &detector["seeds"][0];
        for number in ["auc", "f1", "best_f1"] {
            assert_eq!(numbers["samples"][number], Value::Null, "{detector}");
        }
        assert!(numbers["false_alarms_per_hour"].is_number(), "{detector}");
    }
    let run = evaluate(
        &set,
        &folder.path().join("out"),
        &["--detectors", "contact_classifier"],
    );
    refused(&run, &["contact_classifier", "labels"]);
}

/// Change of a joint state, by its row; false removes it.
type Damage = fn(usize, &mut JointState) -> bool;

#[test]
fn bursts_of_nan_are_counted_alike_by_evaluate_replay_and_run() {
    const BURST: std::ops::Range<usize> = 1000..1040;
    let bursts: [Damage; 4] = [
        |row, state| {
            if BURST.contains(&row) {
                state.effort[2] = f64::NAN;
            }
            true
        },
        |row, state| {
            if BURST.contains(&row) {
                state.position.fill(f64::NAN);
            }
            true
        },
        |row, state| {
            if BURST.contains(&row) {
                state.velocity[6] = f64::NAN;
            }
            true
        },
        |row, state| {
            if BURST.contains(&row) {
                state.effort[0] = f64::INFINITY;
            }
            true
        },
    ];
    for burst in bursts {
        let folder = tempfile::tempdir().unwrap();
        let recording = changed(folder.path(), "demo.mcap", burst);
        let set = Set {
            test: recording.clone(),
            ..Set::default()
        };
        let detectors = LEARNT.join(",");
        let out = evaluate(
            &set.write(folder.path()),
            &folder.path().join("out"),
            &["--detectors", &detectors],
        );
        assert_eq!(out.code, 3, "{}", out.stderr);
        let said = "in 40 messages";
        assert!(out.stdout.contains(said), "{}", out.stdout);

        let arm = arm();
        let file = pipeline(&arm, &recording, None).write(folder.path(), str::to_owned);
        let replayed = replay(&file, &recording, &folder.path().join("replayed"));
        assert_eq!(replayed.code, 3, "{}", replayed.stderr);
        let summary: Value = serde_json::from_str(&replayed.stdout).unwrap();
        assert_eq!(summary[0]["lost"], 40);
        let live = run(&file);
        assert_eq!(live.code, 3, "{}", live.stderr);
        let summary: Value = serde_json::from_str(&live.stdout).unwrap();
        let ingest = &summary["stages"][0];
        assert_eq!(
            (&ingest["stage"], &ingest["dropped"]),
            (&"ingest".into(), &40.into())
        );
    }
}

#[test]
fn a_gap_of_three_seconds_is_told_and_starts_the_filters_anew() {
    let folder = tempfile::tempdir().unwrap();
    let gap = changed(folder.path(), "demo.mcap", |row, _| {
        !(1000..1300).contains(&row)
    });
    let set = Set {
        test: gap,
        ..Set::default()
    };
    let more = ["--detectors", "naive_difference,tauscope"];
    let run = evaluate(&set.write(folder.path()), &folder.path().join("out"), &more);
    assert_eq!(
        run.code, 0,
        "nothing that was recorded is lost: {}",
        run.stderr
    );
    assert!(
        run.stdout.contains("demo: 1 gap in time; "),
        "{}",
        run.stdout
    );
}

#[test]
fn repeated_stamps_change_no_event() {
    let folder = tempfile::tempdir().unwrap();
    let mut before = None;
    let repeated = changed(folder.path(), "demo.mcap", |row, state| {
        match before.replace(state.clone()) {
            // A driver that repeats a message.
            Some(before) if (500..700).contains(&row) && row % 2 == 1 => *state = before,
            _ => {}
        }
        true
    });
    let arm = arm();
    let file = pipeline(&arm, &repeated, None).write(folder.path(), str::to_owned);
    let out = replay(&file, &repeated, &folder.path().join("replayed"));
    assert_eq!(out.code, 0, "{}", out.stderr);
    let summary: Value = serde_json::from_str(&out.stdout).unwrap();
    for detector in summary[0]["detectors"].as_array().unwrap() {
        if detector["detector"] == "tauscope" {
            assert_eq!(
                detector["events"].as_array().unwrap().len(),
                6,
                "{detector}"
            );
        }
    }
}

#[test]
fn a_torn_recording_is_evaluated_up_to_the_tear_wherever_it_stands() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["demo.mcap", "demo_validation.mcap", "demo_train_sweep.mcap"] {
        let whole = std::fs::read(bundled().join(name)).unwrap();
        let torn = folder.path().join(name);
        std::fs::write(&torn, &whole[..whole.len() * 2 / 3]).unwrap();
        let mut set = Set::default();
        let paths = [&mut set.test]
            .into_iter()
            .chain(&mut set.train)
            .chain(&mut set.validation);
        for path in paths.filter(|path| path.file_name() == torn.file_name()) {
            path.clone_from(&torn);
        }
        let out = folder.path().join("out");
        let run = evaluate(
            &set.write(folder.path()),
            &out,
            &["--detectors", "tauscope"],
        );
        assert_eq!(run.code, 3, "{}", run.stderr);
        let said = "the file is torn off here; readable until";
        assert!(run.stdout.contains(said), "{name}: {}", run.stdout);
    }
}

#[test]
fn a_recording_without_efforts_is_no_recording_without_contacts() {
    let folder = tempfile::tempdir().unwrap();
    let bare = changed(folder.path(), "demo.mcap", |_, state| {
        state.effort.clear();
        true
    });
    let set = Set {
        test: bare.clone(),
        ..Set::default()
    };
    let more = ["--detectors", "naive_difference"];
    let run = evaluate(&set.write(folder.path()), &folder.path().join("out"), &more);
    refused(&run, &["demo.mcap: no joint state holds efforts"]);
    let arm = arm();
    let file = pipeline(&arm, &bare, None).write(folder.path(), str::to_owned);
    let mut command = tauscope();
    command.args(["replay", "--pipeline"]).arg(&file).arg(&bare);
    let replayed = Out::of(command);
    assert!(
        replayed.stdout.contains("tauscope: judged no sample"),
        "{}",
        replayed.stdout
    );
}

/// Guards against an index beyond a sample's joints: a hand of 24 joints in one recording.
#[test]
fn a_recording_of_more_joints_than_a_sample_has_is_refused_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let names: Vec<String> = (0..24).map(|j| format!("finger_{j}")).collect();
    let head = names
        .iter()
        .map(|name| format!(",{name}.position,{name}.velocity,{name}.effort"));
    let mut text = format!("time{}\n", head.collect::<String>());
    for row in 0..50 {
        text += &format!(
            "{}{}\n",
            0.01 * f64::from(row),
            ",0.1,0,0.2".repeat(names.len())
        );
    }
    let path = write(&folder.path().join("hand.csv"), &text);
    let body = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
    let mut robot = "<robot name=\"hand\"><link name=\"palm\"/>".to_owned();
    for name in &names {
        robot += &format!(
            "<link name=\"{name}_link\">{body}</link><joint name=\"{name}\" type=\"continuous\"><parent link=\"palm\"/>\
             <child link=\"{name}_link\"/><axis xyz=\"0 0 1\"/></joint>"
        );
    }
    let robot = write(&folder.path().join("hand.urdf"), &(robot + "</robot>"));
    let report = folder.path().join("report");
    let [path, robot, report] = [&path, &robot, &report].map(|path| path.to_str().unwrap());
    let out = Out::answer(["explain", path, "--robot", robot, "--out", report]);
    assert_eq!(out.code, 2, "{}", out.stdout);
    assert!(
        out.stderr.contains("24 joints, and at most 16"),
        "{}",
        out.stderr
    );
}
