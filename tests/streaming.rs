//! A pipeline with the `twin.yaml` and `learnt.yaml` of `evaluate` gives the same events as `evaluate`, with all
//! detectors in parallel.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::labelled_set::{Set, evaluate};
use crate::common::learnt_pipeline::{LearntPipeline, replay};
use crate::common::{Out, bundled, tauscope, write};
use serde_json::Value;

/// Events of a replay, by detector, and those that `evaluate` wrote.
fn both(replayed: &Out, evaluated: &Path, recording: &str) -> Vec<(String, Value, Value)> {
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    let summary: Value = serde_json::from_str(&replayed.stdout).unwrap();
    let detectors = summary[0]["detectors"].as_array().unwrap();
    let both = detectors.iter().map(|replayed| {
        let name = replayed["detector"].as_str().unwrap();
        let file = evaluated.join(format!("{recording}.{name}.json"));
        let wrote: Value = serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
        (
            name.to_owned(),
            replayed["events"].clone(),
            wrote["events"].clone(),
        )
    });
    both.collect()
}

/// Replays a set's test recording through a pipeline with the evaluation's results in `out`: the given number of
/// detectors must find the same events, and at least one.
fn finds_in_a_pipeline_what_was_found(
    folder: &Path,
    set: &Set,
    out: &Path,
    (name, count): (&str, usize),
) {
    let pipeline = LearntPipeline {
        evaluated: out,
        robot: &set.robot,
        recording: &set.test,
        twin: None,
    };
    let pipeline = pipeline.write(folder, str::to_owned);
    let replayed = replay(&pipeline, &set.test, &folder.join("replayed"));
    let all = both(&replayed, out, name);
    assert_eq!(all.len(), count);
    for (detector, replayed, evaluated) in all {
        assert_eq!(replayed, evaluated, "{detector}");
        assert!(!replayed.as_array().unwrap().is_empty(), "{detector}");
    }
}

/// `learnt.yaml` holds the parameters learnt from a validation recording; no other state is carried over from it.
#[test]
fn a_pipeline_of_what_was_learnt_finds_what_evaluate_found() {
    let detectors = "naive_difference,twin_regression,momentum_observer,virtual_collision_sensor_basic,\
                     virtual_collision_sensor,tauscope";
    let validated = Set::default();
    let trained = Set {
        validation: Vec::new(),
        ..Set::default()
    };
    let with_machine = format!("{detectors},window_ocsvm");
    for (set, detectors, count) in [(validated, detectors, 6), (trained, &with_machine, 7)] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let run = evaluate(&set.write(folder.path()), &out, &["--detectors", detectors]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        finds_in_a_pipeline_what_was_found(folder.path(), &set, &out, ("demo", count));
    }
}

/// Detectors that need collisions, cooperations and a high rate.
#[test]
fn the_classifiers_find_in_a_pipeline_what_they_found_in_evaluate() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = format!(
        "version: 1
name: pushes
robot: {robot}
seed: 3
rate_hz: 500
sensors: {{effort_noise_nm: 0.05}}
recordings:
- name: learn
  role: train
  duration_s: 14
  motion: &there {{points: {{through: [[0, 0.5, 0, 1.2, 0, 0.6, 0], [0.5, 0.8, 0, 1.0, 0, 0.6, 0]], speed: 0.5, rest_s: [0.1, 0.1]}}}}
  contacts: &contacts
  - {{link: link6, force_n: [0, -40, 0], t_on_s: 3.0, t_off_s: 3.2, rise_s: 0.02, kind: collision}}
  - {{link: link6, force_n: [25, 0, 0], t_on_s: 5.0, t_off_s: 6.0, rise_s: 0.1, kind: cooperation}}
  - {{link: link6, force_n: [0, 45, 0], t_on_s: 8.0, t_off_s: 8.2, rise_s: 0.02, kind: collision}}
  - {{link: link6, force_n: [0, 0, 30], t_on_s: 10.0, t_off_s: 11.0, rise_s: 0.1, kind: cooperation}}
- {{name: touched, role: test, duration_s: 14, motion: *there, contacts: *contacts}}
",
        robot = bundled().join("demo_arm.urdf").display()
    );
    let file = write(&folder.path().join("pushes.yaml"), &scenario);
    let mut simulate = tauscope();
    simulate
        .arg("simulate")
        .arg(&file)
        .arg("--out")
        .arg(folder.path());
    let made = Out::of(simulate);
    assert_eq!(made.code, 0, "{}", made.stderr);
    let recording = |name: &str| folder.path().join(name);
    let set = Set {
        robot: bundled().join("demo_arm.urdf"),
        labels: Some(recording("labels.json")),
        train: vec![recording("learn.mcap")],
        validation: Vec::new(),
        test: recording("touched.mcap"),
        more: "",
    };
    let detectors =
        "momentum_observer,contact_classifier,fisher_discriminant,frequency_classifier,tauscope";
    let out = recording("out");
    let run = evaluate(&set.write(folder.path()), &out, &["--detectors", detectors]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    finds_in_a_pipeline_what_was_found(folder.path(), &set, &out, ("touched", 5));
}
