//! The motion that explain proposes distinguishes the alternatives of its report: an arm with one member of a class
//! moves poorly, then as proposed.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::{Out, bundled, tauscope, write};
use serde_json::{Value, json};

/// Simulates recordings of the bundled arm with this physics.
fn simulate(folder: &Path, seed: u64, physics: &Value, recordings: &Value) {
    let scenario = json!({
        "version": 1, "robot": bundled().join("demo_arm.urdf"), "seed": seed, "rate_hz": 100, "physics": [physics],
        "sensors": {"position_noise_rad": 1e-5, "velocity_noise_rad_s": 0.001, "effort_noise_of_limit": 0.002},
        "recordings": recordings,
    });
    let file = write(
        &folder.join(format!("scenario_{seed}.yaml")),
        &scenario.to_string(),
    );
    let mut simulate = tauscope();
    simulate.arg("simulate").arg(file).arg("--force");
    simulate.arg("--out").arg(folder);
    let out = Out::of(simulate);
    assert_eq!(out.code, 0, "{}", out.stderr);
}

/// Report of explain on the recordings in `fit`.
fn explain(folder: &Path, fit: &[&str], out: &str) -> Value {
    let recording = |name: &str| folder.join(format!("{name}.mcap"));
    let mut explain = tauscope();
    explain.arg("explain").arg("--robot");
    explain.arg(bundled().join("demo_arm.urdf")).arg("--fit");
    explain.args(fit.iter().map(|name| recording(name)));
    explain.arg("--holdout").arg(recording("poor_2"));
    explain.arg("--out").arg(folder.join(out));
    let ended = Out::of(explain);
    assert_eq!(ended.code, 0, "{}", ended.stderr);
    let report = folder.join(out).join("report.json");
    serde_json::from_str(&std::fs::read_to_string(report).unwrap()).unwrap()
}

/// The only finding: its effect, its joint, and the number of alternatives.
fn found(report: &Value) -> (&str, &str, usize) {
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "{findings:?}");
    let text = |key: &str| findings[0][key].as_str().unwrap();
    let rivals = findings[0]["equivalent_to"].as_array().unwrap();
    (text("effect"), text("joint"), rivals.len())
}

/// Asserts that the motion proposed for an arm with this physics, after small strokes of these harmonics, splits the
/// class.
fn splits(physics: &Value, range: f64, harmonics: u32) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let about = [0.0, 0.7, 0.0, 1.3, 0.0, 0.9, 0.0];
    let poor = |name: &str, period_s: f64| {
        json!({"name": name, "duration_s": 10, "motion": {"fourier": {"period_s": period_s, "harmonics": harmonics,
            "speed": 0.4, "acceleration_rad_s2": 2.5, "range": range, "about": about}}})
    };
    let recordings = json!([
        poor("poor_0", 10.0),
        poor("poor_1", 8.0),
        poor("poor_2", 9.0)
    ]);
    simulate(folder, 11, physics, &recordings);
    let report = explain(folder, &["poor_0", "poor_1"], "poor");
    let (name, _, rivals) = found(&report);
    assert!(rivals > 0, "{physics}: {name} stands alone already");
    let next = &report["next_motions"][0];
    let file = folder
        .join("poor")
        .join(next["trajectory"].as_str().unwrap());
    let rows = std::fs::read_to_string(&file).unwrap();
    let last = rows.lines().last().unwrap().split(',').next().unwrap();
    let duration_s: f64 = last.parse().unwrap();

    let columns = json!({"time": {"name": "t"}, "position": {"first": 2}, "header": true});
    let recordings = json!([{"name": "next", "duration_s": duration_s,
        "motion": {"recorded": {"path": file, "columns": columns}}}]);
    simulate(folder, 12, physics, &recordings);
    let report = explain(folder, &["poor_0", "poor_1", "next"], "split");
    let truth = (
        physics["effect"].as_str().unwrap(),
        physics["joint"].as_str().unwrap(),
    );
    let (name, joint, rivals) = found(&report);
    assert_eq!((name, joint), truth, "{}", report["findings"]);
    assert_eq!(rivals, 0, "{}", report["findings"]);
}

#[test]
fn a_spring_is_told_from_an_offset() {
    let spring = json!({"effect": "cable_spring", "joint": "joint4",
        "parameters": {"stiffness_nm_per_rad": 6, "rest_angle_rad": 0.5}});
    splits(&spring, 0.15, 3);
}

#[test]
fn a_gain_is_told_from_an_offset_and_a_mass() {
    // Far beyond the effect of slightly wrong masses.
    let gain = json!({"effect": "torque_gain", "joint": "joint2", "parameters": {"gain": 1.4}});
    splits(&gain, 0.15, 3);
}
