//! Test of a residual watch in a pipeline: a friction step in a simulated stream is identified, in replay and live.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::{Out, bundled, tauscope, write};

/// Time of the friction step in the recording \[s\].
const STEP_S: f64 = 42.0;

/// A recording in which the friction of joint 2 steps, and a pipeline that watches it with the unmodified URDF.
fn set_up(folder: &Path) -> (std::path::PathBuf, std::path::PathBuf) {
    let robot = bundled().join("demo_arm.urdf");
    let scenario = format!(
        "version: 1
name: step
robot: {robot}
seed: 3
rate_hz: 100
physics:
  - {{effect: friction_step, joint: joint2, parameters: {{coulomb_before_nm: 0.9, coulomb_after_nm: 2.4, change_time_session_s: {STEP_S}}}}}
  - {{effect: coulomb_friction, joint: joint4, parameters: {{coulomb_nm: 0.5}}}}
  - {{effect: viscous_friction, joint: joint4, parameters: {{viscous_nms_per_rad: 0.7}}}}
sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}
recordings:
  - name: step
    duration_s: 62
    motion: {{fourier: {{period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}}}
",
        robot = robot.display(),
    );
    let scenario = write(&folder.join("scenario.yaml"), &scenario);
    let mut simulate = tauscope();
    simulate.arg("simulate").arg(scenario).arg("--force");
    let out = Out::of({
        simulate.arg("--out").arg(folder);
        simulate
    });
    assert_eq!(out.code, 0, "{}", out.stderr);
    let recording = folder.join("step.mcap");
    let pipeline = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: fast}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: watch, input: twin, watch: {{}}}}
- {{name: record, inputs: [ingest, twin, watch], record: {{mcap: run.mcap}}}}
",
        robot = robot.display(),
        recording = recording.display(),
    );
    (write(&folder.join("pipeline.yaml"), &pipeline), recording)
}

#[test]
fn a_friction_step_is_named_in_replay_and_live_alike() {
    let folder = tempfile::tempdir().unwrap();
    let (pipeline, recording) = set_up(folder.path());
    let mut replay = tauscope();
    replay.arg("replay").arg("--json").arg("--pipeline");
    replay.arg(&pipeline).arg(&recording);
    let out = Out::of({
        replay.arg("--out").arg(folder.path().join("out"));
        replay
    });
    assert_eq!(out.code, 0, "{}", out.stderr);
    let summary: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let watch = &summary[0]["detectors"][0];
    assert_eq!(watch["detector"], "residual_watch");
    let events = watch["events"].as_array().unwrap();
    assert_eq!(events.len(), 1, "{watch}");
    let event = &events[0];
    let number = |key: &str| event[key].as_f64().unwrap();
    assert_eq!(event["kind"], "coulomb_friction");
    assert_eq!(event["joints"], serde_json::json!(["joint2"]));
    assert!((number("size") - 1.5).abs() < 0.15, "{event}");
    assert!((number("t_contact") - STEP_S).abs() < 1.5, "{event}");
    assert!(number("t") - STEP_S < 11.0, "{event}");

    let mut run = tauscope();
    run.arg("run").arg(&pipeline);
    let out = Out::of(run);
    assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    let said = format!(
        "{:8.3} s  since {:.1} s: coulomb friction {:+.2} N m at joint2",
        number("t"),
        number("t_contact"),
        number("size")
    );
    assert!(out.stderr.contains(&said), "{said}\n{}", out.stderr);
}
