//! Irregularities of a labelled set: refused with their place, or evaluated with a note; never silently ignored.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::labelled_set::{Set, changed, evaluate};
use crate::common::{Out, bundled, shared, skipped, tauscope, write};
use serde_json::Value;

const LIGHT: [&str; 2] = ["--detectors", "naive_difference,twin_regression"];

/// Evaluates `set`, which must succeed.
fn summary(set: &Set, folder: &Path, detectors: &str) -> Value {
    let more = ["--json", "--detectors", detectors];
    let out = evaluate(&set.write(folder), &folder.join("out"), &more);
    assert_eq!(out.code, 0, "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

fn notes(summary: &Value) -> String {
    summary["notes"].to_string()
}

fn refused(set: &Set, said: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let run = evaluate(
        &set.write(folder.path()),
        &folder.path().join("out"),
        &LIGHT,
    );
    assert_eq!(run.code, 2, "{}", run.stderr);
    for said in said {
        assert!(run.stderr.contains(said), "{said}: {}", run.stderr);
    }
}

fn with(more: &'static str) -> Set {
    Set {
        more,
        ..Set::default()
    }
}

/// A set with these labels.
fn labelled(folder: &Path, recordings: &str) -> Set {
    let text = format!(r#"{{"recordings": {{{recordings}}}}}"#);
    Set {
        labels: Some(write(&folder.join("own.json"), &text)),
        ..Set::default()
    }
}

#[test]
fn torque_constants_that_are_none_are_refused_at_their_place() {
    refused(
        &with("effort_unit: A\ntorque_constants_nm_per_a: {joint1: 11, joint2: 0}"),
        &[
            "a torque constant is more than 0, found 0",
            "no torque constant for `joint3`, `joint4`",
            "set.yaml:9:",
        ],
    );
}

#[test]
fn times_and_stiffnesses_below_zero_are_refused_at_their_place() {
    refused(
        &with(
            "cycle_s: -1\nfree_first_s: -2\nimpedance: {translational_n_per_m: -3, rotational_nm_per_rad: 1}",
        ),
        &[
            "`cycle_s`",
            "`free_first_s`",
            "`impedance.translational_n_per_m`",
        ],
    );
}

#[test]
fn a_set_without_robot_needs_a_twin_on_a_topic() {
    let folder = tempfile::tempdir().unwrap();
    let set = Set::default().write(folder.path());
    let text = std::fs::read_to_string(&set).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("robot"));
    write(&set, &lines.collect::<Vec<_>>().join("\n"));
    let run = evaluate(&set, &folder.path().join("out"), &LIGHT);
    assert_eq!(run.code, 2, "{}", run.stderr);
    let said = "neither a `robot` nor the topic of another twin";
    assert!(run.stderr.contains(said), "{}", run.stderr);
}

#[test]
fn behind_a_twin_on_a_topic_what_needs_no_model_runs_without_a_robot() {
    const TEST: &str = "behind_a_twin_on_a_topic_what_needs_no_model_runs_without_a_robot";
    let Some(shared) = shared(TEST) else { return };
    let Ok(cyclic) = shared.join("contacts/cyclic").canonicalize() else {
        return skipped(TEST, "../shared/contacts/cyclic is absent");
    };
    let folder = tempfile::tempdir().unwrap();
    let recording = |number| format!("[{}/recordings/rec_{number}.mcap]", cyclic.display());
    let text = format!(
        "set: cyclic\nlabels: {}/labels.json\neffort_unit: A\ncycle_s: 9.392\ntopics: {{twin: /twin/joint_states}}\ntrain: {}\nvalidation: {}\ntest: {}\n",
        cyclic.display(),
        recording("000"),
        recording("001"),
        recording("002"),
    );
    let set = write(&folder.path().join("set.yaml"), &text);
    let out = folder.path().join("out");
    let sensors = "virtual_collision_sensor,virtual_collision_sensor_basic";
    let run = evaluate(&set, &out, &["--json", "--detectors", sensors]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let summary: Value = serde_json::from_str(&run.stdout).unwrap();
    for detector in summary["detectors"].as_array().unwrap() {
        assert_eq!(detector["seeds"][0]["found"], 1, "{detector}");
    }
    let run = evaluate(&set, &out, &["--detectors", "momentum_observer"]);
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(
        run.stderr.contains("needs the robot's model"),
        "{}",
        run.stderr
    );
}

#[test]
fn labels_beyond_a_recording_are_noted_and_take_no_time_that_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let set = labelled(
        folder.path(),
        r#""demo_validation": {}, "gone": {}, "demo": {"duration": 9000, "events": [{"t_on": 20, "t_off": 9000, "link": "lnik5"}]}"#,
    );
    let summary = summary(&set, folder.path(), LIGHT[1]);
    let numbers = &summary["detectors"][1]["seeds"][0];
    let free_s = 3600.0 * numbers["free_hours"].as_f64().unwrap();
    assert!((free_s - 20.0).abs() < 1e-6, "{free_s}");
    assert!(numbers["false_alarms_per_hour"].as_f64() > Some(0.0));
    let notes = notes(&summary);
    for said in [
        "demo: the labels give it a length of 9000 s",
        "demo: 1 labelled contact reaches beyond the recording",
        "labelled, but not in the set: gone",
        "the link `lnik5` in 1 contact, which the robot does not have",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
}

#[test]
fn a_kind_that_is_none_is_refused_with_recording_and_event() {
    let folder = tempfile::tempdir().unwrap();
    let set = labelled(
        folder.path(),
        r#""demo": {"events": [{"t_on": 1, "t_off": 2}, {"t_on": 3, "t_off": 4, "kind": "colision"}]}"#,
    );
    refused(
        &set,
        &[
            "`demo`: event 2, at 3 s: there is no kind `colision`",
            "did you mean `collision`?",
            "own.json",
        ],
    );
}

#[test]
fn a_set_in_which_all_is_well_has_no_note() {
    let folder = tempfile::tempdir().unwrap();
    let summary = summary(&with("rate_hz: 100"), folder.path(), LIGHT[1]);
    assert_eq!(notes(&summary), "[]");
}

#[test]
fn another_rate_and_another_number_of_cycles_than_the_set_says_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let set = with("rate_hz: 50\ncycle_s: 5\nlearning_cycles: 2");
    let notes = notes(&summary(&set, folder.path(), LIGHT[1]));
    assert!(
        notes.contains("`rate_hz` is 50, and 4 of 4 recordings"),
        "{notes}"
    );
    assert!(notes.contains("`learning_cycles` is 2"), "{notes}");
}

#[test]
fn recordings_that_are_too_short_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let short = |name, rows| changed(folder.path(), name, move |row, _| row < rows);
    let set = Set {
        train: vec![short("demo_train_sweep.mcap", 150)],
        validation: vec![short("demo_validation.mcap", 150)],
        test: short("demo.mcap", 41),
        labels: None,
        ..Set::default()
    };
    let notes = notes(&summary(&set, folder.path(), LIGHT[1]));
    for said in [
        "of its 41 samples were not judged",
        "what is learnt from so little is unreliable",
        "s of the validation recordings: how often they are exceeded",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
}

#[test]
fn a_dead_effort_and_joints_that_stood_still_in_training_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let train = changed(folder.path(), "demo_train_sweep.mcap", |_, state| {
        state.position[0] = 0.5;
        state.velocity[0] = 0.0;
        true
    });
    let test = changed(folder.path(), "demo.mcap", |_, state| {
        state.effort[2] = 1.25;
        true
    });
    let set = Set {
        train: vec![train],
        test,
        ..Set::default()
    };
    let notes = notes(&summary(&set, folder.path(), LIGHT[1]));
    for said in [
        "the effort of joint3 never changes in demo:",
        "still in the train recordings, but not in the test recordings: joint1;",
    ] {
        assert!(notes.contains(said), "{said}: {notes}");
    }
}

#[test]
fn a_detector_whose_threshold_no_score_reaches_is_noted_and_finds_with_a_lower_one() {
    let folder = tempfile::tempdir().unwrap();
    let usual = summary(&Set::default(), folder.path(), "point_ocsvm");
    let said = "point_ocsvm can never raise an alarm";
    assert!(notes(&usual).contains(said), "{usual}");
    assert_eq!(usual["detectors"][0]["seeds"][0]["alarms"], 0);
    let set = with("detectors: {threshold: {sigmas: 1}}");
    let lower = summary(&set, folder.path(), "point_ocsvm");
    assert_eq!(notes(&lower), "[]");
    assert!(lower["detectors"][0]["seeds"][0]["alarms"].as_u64() > Some(0));
}

#[test]
fn a_set_gives_detectors_their_settings() {
    let folder = tempfile::tempdir().unwrap();
    let set = with(
        "detectors: {momentum_observer: {cutoff_hz: 8}, tauscope: {false_alarms_per_hour: 0.5}, point_autoencoder: {training: {epochs: 2}}}",
    );
    let names = "momentum_observer,tauscope,point_autoencoder";
    let summary = summary(&set, folder.path(), names);
    let learnt = std::fs::read_to_string(folder.path().join("out/learnt.yaml")).unwrap();
    for said in [
        "cutoff_hz: 8",
        "false_alarms_per_hour: 0.5",
        "epochs: 2\n",
        "batch: 1000",
    ] {
        assert!(learnt.contains(said), "{said}: {learnt}");
    }
    let tables = summary["tables"].to_string();
    assert!(tables.contains("0.5 an hour: half"), "{tables}");
}

#[test]
fn settings_that_no_detector_has_or_that_are_learnt_here_are_refused_at_their_place() {
    refused(
        &with("detectors: {tauscop: {}, momentum_observer: {cutof_hz: 8}}"),
        &[
            "unknown key `tauscop`",
            "did you mean `cutoff_hz`?",
            "set.yaml:8:",
        ],
    );
    refused(
        &with("detectors: {point_ocsvm: {model: a.safetensors}}"),
        &["`model` of point_ocsvm", "leave `model` out", "set.yaml:8:"],
    );
}

#[test]
fn a_zone_without_a_move_and_a_move_without_a_zone_have_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let set = labelled(
        folder.path(),
        r#""demo": {"events": [{"t_on": 3.2, "t_off": 4.0, "zone": "far"}, {"t_on": 7.6, "t_off": 8.3, "move": "down"}]}"#,
    );
    let summary = summary(&set, folder.path(), LIGHT[1]);
    let tables = summary["tables"].as_array().unwrap();
    let cyclic = tables.iter().find(|table| {
        let title = table["title"].as_str().unwrap();
        title.contains("tables 1 to 4")
    });
    let rows = cyclic.unwrap()["rows"].to_string();
    assert!(
        rows.contains("\"far\"") && rows.contains("\"down\""),
        "{rows}"
    );
}

#[test]
fn what_has_no_training_has_no_training_time_and_without_tests_it_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let scored = summary(&Set::default(), folder.path(), LIGHT[1]);
    let table = |summary: &Value, title: &str| {
        let tables = summary["tables"].as_array().unwrap();
        let found = tables
            .iter()
            .find(|t| t["title"].as_str().unwrap().starts_with(title));
        found.unwrap().clone()
    };
    let samples = table(&scored, "Sample by sample");
    assert_eq!(samples["rows"][0][1], "-", "{samples}");
    assert_ne!(samples["rows"][1][1], "-", "{samples}");

    let set = Set::default().write(folder.path());
    let text = std::fs::read_to_string(&set).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with("test:"));
    write(&set, &lines.collect::<Vec<_>>().join("\n"));
    let more = [&["--json"], &LIGHT[..]].concat();
    let run = evaluate(&set, &folder.path().join("out"), &more);
    let bare = table(&serde_json::from_str(&run.stdout).unwrap(), "Detections");
    assert_eq!(
        bare["note"],
        "There are no test recordings: nothing was scored."
    );
    assert_eq!(bare["rows"][0][0], "naive_difference");
    assert_eq!(bare["rows"][0][3], "0.0");
}

#[test]
fn a_push_on_a_link_that_cannot_move_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(bundled().join("demo.scenario.yaml")).unwrap();
    let text = text
        .replace("link: link5, force_n", "link: base, force_n")
        .replace("robot: ", &format!("robot: {}/", bundled().display()));
    let scenario = write(&folder.path().join("scenario.yaml"), &text);
    let mut simulate = tauscope();
    simulate
        .args(["simulate", "--force"])
        .arg(scenario)
        .arg("--out")
        .arg(folder.path().join("out"));
    let out = Out::of(simulate);
    assert_eq!(out.code, 2, "{}", out.stderr);
    let said = "a contact is on link `base`, which no joint moves";
    assert!(out.stderr.contains(said), "{}", out.stderr);
}
