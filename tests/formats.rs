//! One motion in every format for joint states: every command gives the same results as with MCAP.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::common::formats;
use crate::common::formats::Format;
use crate::common::labelled_set::{Set, evaluate};
use crate::common::{Out, bundled, write};
use serde_json::Value;
use tauscope_twin::TwinFile;

/// Formats that store stamps, names, positions, velocities and efforts exactly as MCAP does.
const EXACT: [Format; 3] = [
    formats::dynamic_joint_states,
    formats::ros1_bag,
    formats::lerobot,
];

fn answer(arguments: &[&OsStr]) -> Out {
    let out = Out::answer(arguments);
    assert_eq!(out.code, 0, "{}", out.stderr);
    out
}

/// Asserts that `what` gives the same result for all formats as for MCAP.
fn alike<T: PartialEq + std::fmt::Debug>(what: impl Fn(&Path, Format) -> T) {
    let expected = what(tempfile::tempdir().unwrap().path(), formats::mcap);
    for format in EXACT {
        let found = what(tempfile::tempdir().unwrap().path(), format);
        assert_eq!(found, expected);
    }
}

#[test]
fn info_finds_the_same_joints() {
    alike(|folder, format| {
        let recording = format(folder, "demo_train_sweep");
        let out = answer(&["info".as_ref(), recording.as_ref(), "--json".as_ref()]);
        let info: Value = serde_json::from_str(&out.stdout).unwrap();
        assert_eq!(info["damage"], serde_json::json!([]));
        let topic = &info["topics"][0];
        ["joints", "message_count", "rate_hz"].map(|key| topic[key].clone())
    });
}

#[test]
fn calibrate_finds_the_same_gains_and_offsets() {
    alike(|folder, format| {
        let recording = format(folder, "demo_train_sweep");
        let twin = folder.join("twin.yaml");
        answer(&[
            "calibrate".as_ref(),
            recording.as_ref(),
            "--robot".as_ref(),
            bundled().join("demo_arm.urdf").as_ref(),
            "--out".as_ref(),
            twin.as_ref(),
        ]);
        let text = std::fs::read_to_string(twin).unwrap();
        let file: TwinFile = serde_saphyr::from_str(&text).unwrap();
        format!("{:?} {:?}", file.joints, file.scores)
    });
}

#[test]
fn replay_finds_the_same_contacts() {
    alike(|folder, format| {
        let recording = format(folder, "demo");
        let data = bundled();
        let text = format!(
            "version: 1\ncells: {{demo: {{robot: {robot}}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {recording}}}}}}}\n\
             - {{name: twin, input: ingest, twin: {{model: {model}}}}}\n\
             - {{name: detect, input: twin, detect: {{tauscope: {{learnt: {learnt}}}}}}}\n",
            robot = data.join("demo_arm.urdf").display(),
            recording = recording.display(),
            model = data.join("demo.explained.yaml").display(),
            learnt = data.join("demo.learnt.yaml").display(),
        );
        let pipeline = write(&folder.join("pipeline.yaml"), &text);
        let out = answer(&[
            "replay".as_ref(),
            recording.as_ref(),
            "--pipeline".as_ref(),
            pipeline.as_ref(),
            "--json".as_ref(),
        ]);
        let summary: Value = serde_json::from_str(&out.stdout).unwrap();
        let events = summary[0]["detectors"][0]["events"].clone();
        assert_eq!(events.as_array().unwrap().len(), 6, "{events}");
        events
    });
}

#[test]
fn evaluate_scores_the_same() {
    alike(|folder, format| {
        let set = Set {
            train: vec![format(folder, "demo_train_sweep")],
            validation: vec![format(folder, "demo_validation")],
            test: format(folder, "demo"),
            ..Set::default()
        };
        let more = ["--json", "--detectors", "twin_regression"];
        let run = evaluate(&set.write(folder), &folder.join("out"), &more);
        assert_eq!(run.code, 0, "{}", run.stderr);
        let summary: Value = serde_json::from_str(&run.stdout).unwrap();
        let scores = summary["detectors"][0]["seeds"][0]["samples"].clone();
        assert!(scores["auc"].is_number(), "{summary}");
        scores
    });
}

#[test]
fn init_and_its_explanation_find_the_same_physics() {
    alike(initialised);
}

/// The physics that `tauscope init` finds in the bundled recordings without contact.
fn initialised(folder: &Path, format: Format) -> String {
    let free: Vec<PathBuf> = ["demo_train_points", "demo_train_sweep", "demo_validation"]
        .iter()
        .map(|name| format(folder, name))
        .collect();
    let robot = bundled().join("demo_arm.urdf");
    let cell = folder.join("cell");
    let mut arguments: Vec<&OsStr> = vec!["init".as_ref()];
    arguments.extend(free.iter().map(|path| path.as_os_str()));
    arguments.extend(["--robot".as_ref(), robot.as_os_str()]);
    arguments.extend(["--out".as_ref(), cell.as_os_str()]);
    answer(&arguments);
    let twin = std::fs::read_to_string(cell.join("twin.yaml")).unwrap();
    let file: TwinFile = serde_saphyr::from_str(&twin).unwrap();
    assert!(!file.terms.is_empty(), "{twin}");
    // The time of an episode of a data set starts at 0, so a session has other instants and other last digits. The
    // noise is estimated from these, and with it small corrections of the bodies, which are those of the URDF.
    let mut terms: Vec<String> = file
        .terms
        .iter()
        .filter(|term| term.effect != "link_inertia")
        .map(|term| {
            let parameters = term.parameters.iter();
            let rounded = parameters.map(|(name, value)| format!("{name} {value:.1}"));
            let rounded = rounded.collect::<Vec<_>>();
            format!(
                "{} {:?} {:?} {rounded:?}",
                term.effect, term.joint, term.link
            )
        })
        .collect();
    terms.sort();
    terms.join("\n")
}
