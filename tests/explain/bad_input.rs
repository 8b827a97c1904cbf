//! Data that allows no verdict, lost rows, and refused input.

use std::path::Path;

use serde_json::Value;
use tauscope_archive::ros::JointState;

use super::{case, changed, explain, explain_case, named, pair, report, robot, states};
use crate::common::{Out, root, write};

/// Asserts that the data allows no verdict: a reason, and exit code 0.
fn not_evaluated(out: &Path, done: &Out, reason: &str) {
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(out);
    assert_eq!(report["verdict"], "not_evaluated");
    assert_eq!(named(&report), []);
    let said = report["reason"].as_str().unwrap();
    assert!(said.contains(reason), "{said}");
    assert!(done.stdout.contains(reason), "{}", done.stdout);
    assert!(!out.join("twin.yaml").exists());
}

#[test]
fn one_recording_that_is_too_short_to_be_parted_proves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    // Files of an earlier explanation must not remain next to a report without findings.
    std::fs::create_dir(&out).unwrap();
    write(&out.join("report.json"), "{}");
    write(&out.join("twin.yaml"), "");
    let joints = ["rail", "turn", "lift", "elbow", "bend", "roll"];
    let head = joints.map(|name| format!(",{name}.position,{name}.velocity,{name}.effort"));
    let mut text = format!("time{}\n", head.concat());
    for row in 0..150 {
        let t = 0.01 * f64::from(row);
        let values = format!(",{},{},{}", t.sin(), t.cos(), 2.0 * t.cos());
        text += &format!("{t}{}\n", values.repeat(joints.len()));
    }
    let (robot, recording) = (
        robot("slide"),
        write(&folder.path().join("short.csv"), &text),
    );
    let done = explain(
        &out,
        &[
            "--robot",
            robot.to_str().unwrap(),
            "--fit",
            recording.to_str().unwrap(),
        ],
    );
    not_evaluated(&out, &done, "only one recording");
}

#[test]
fn an_arm_at_rest_tells_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let still = changed(folder.path(), "m01", &[], |_, state| {
        state.position.fill(0.1);
        state.velocity.fill(0.0);
    });
    let out = folder.path().join("out");
    not_evaluated(&out, &explain_case(&out, &still), "no joint moves");
}

#[test]
fn an_effort_that_is_zero_throughout_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let zero = changed(folder.path(), "m01", &[], |_, state| state.effort.fill(0.0));
    let out = folder.path().join("out");
    not_evaluated(&out, &explain_case(&out, &zero), "effort is zero");
}

/// Asserts that a fault of the recordings is a finding of this kind with these words, and that no twin for a pipeline
/// is written.
fn slip(name: &str, kind: &str, words: &[&str], change: impl Fn(usize, &mut JointState)) {
    let folder = tempfile::tempdir().unwrap();
    let case = changed(folder.path(), name, &[], change);
    let out = folder.path().join("out");
    let done = explain_case(&out, &case);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(&out);
    // Velocities are computed from the positions, so a fault of the velocity alone is no unknown physics.
    let verdict = match kind {
        "velocity_scale" => "explained",
        _ => "unknown_remains",
    };
    assert_eq!(report["verdict"], verdict);
    let findings = report["findings"].as_array().unwrap();
    let of_kind = |finding: &&Value| finding["parameters"]["kind"] == kind;
    let found = findings
        .iter()
        .find(of_kind)
        .unwrap_or_else(|| panic!("{findings:?}"));
    assert_eq!(found["effect"], "unknown");
    let sentence = found["sentence"].as_str().unwrap();
    for word in words {
        assert!(sentence.contains(word), "{sentence}");
    }
    // A pipeline does not use a velocity that is not the derivative of the position.
    let holds_in_a_pipeline = kind == "velocity_scale";
    assert_eq!(out.join("twin.yaml").exists(), holds_in_a_pipeline);
    assert!(!out.join("robot.urdf").exists());
    // Predictions are for the columns as they were recorded.
    let after = report["holdout_rms_after"].as_array().unwrap();
    let before = report["holdout_rms_before"].as_array().unwrap();
    let sum = |all: &[Value]| all.iter().map(|x| x.as_f64().unwrap().powi(2)).sum::<f64>();
    if kind != "velocity_scale" {
        assert!(sum(after) < 0.2 * sum(before), "{after:?} after {before:?}");
    }
}

#[test]
fn efforts_that_follow_another_motion_are_another_robots() {
    let folder = tempfile::tempdir().unwrap();
    let other = changed(folder.path(), "m01", &[], |row, state| {
        for (joint, effort) in state.effort.iter_mut().enumerate() {
            *effort = 30.0 * (0.013 * row as f64 * (joint + 1) as f64).sin();
        }
    });
    let out = folder.path().join("out");
    not_evaluated(&out, &explain_case(&out, &other), "another robot");
}

#[test]
fn efforts_in_another_unit_are_a_finding_with_the_unit() {
    slip("m01", "effort_unit", &["--effort-unit A"], |_, state| {
        state
            .effort
            .iter_mut()
            .enumerate()
            .for_each(|(j, effort)| *effort /= 12.0 + 4.0 * j as f64);
    });
}

#[test]
fn swapped_efforts_are_a_finding_and_what_is_left_is_explained() {
    slip(
        "m00",
        "efforts_swapped",
        &["lift", "elbow", "Exchange", "falls from"],
        |_, state| {
            let at = |name: &str| state.name.iter().position(|own| own == name).unwrap();
            let (a, b) = (at("lift"), at("elbow"));
            state.effort.swap(a, b);
        },
    );
}

#[test]
fn a_velocity_that_is_half_the_change_of_position_is_a_finding() {
    slip(
        "m00",
        "velocity_scale",
        &["all joints", "0.5"],
        |_, state| {
            state
                .velocity
                .iter_mut()
                .for_each(|velocity| *velocity *= 0.5);
        },
    );
}

#[test]
fn degrees_are_a_finding() {
    slip("m00", "degrees", &["degrees"], |_, state| {
        let angles = state.position.iter_mut().chain(&mut state.velocity);
        angles.for_each(|x| *x = x.to_degrees());
    });
}

#[test]
fn rows_that_are_lost_are_said_and_end_with_3() {
    let folder = tempfile::tempdir().unwrap();
    let holes = changed(folder.path(), "m01", &["rec_00", "rec_03"], |row, state| {
        if row % 100 == 50 {
            state.effort[2] = f64::NAN;
        }
    });
    let out = folder.path().join("out");
    let done = explain_case(&out, &holes);
    assert_eq!(done.code, 3, "{}", done.stderr);
    assert!(done.stdout.contains("NaN in 6 messages"), "{}", done.stdout);
    assert_eq!(named(&report(&out)), [pair("viscous_friction", "roll")]);
    let predictions = std::fs::read_to_string(out.join("rec_03.csv")).unwrap();
    let rows: Vec<&str> = predictions.lines().collect();
    assert_eq!(rows.len(), states(&folder.path().join("rec_03.mcap")).len());
    let lost = rows.iter().enumerate();
    let lost: Vec<usize> = lost
        .filter_map(|(row, text)| text.contains("NaN").then_some(row % 100))
        .collect();
    assert!(
        !lost.is_empty() && lost.iter().all(|row| *row == 50),
        "{lost:?}"
    );
}

#[test]
fn a_torn_tail_is_read_up_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let whole = changed(folder.path(), "m01", &["rec_00"], |_, _| {});
    let torn = folder.path().join("rec_00.mcap");
    let bytes = std::fs::read(&torn).unwrap();
    std::fs::write(&torn, &bytes[..bytes.len() * 8 / 10]).unwrap();
    let out = folder.path().join("out");
    let done = explain_case(&out, &whole);
    assert_eq!(done.code, 3, "{}", done.stderr);
    assert_eq!(named(&report(&out)), [pair("viscous_friction", "roll")]);
}

/// Asserts that wrong arguments or files give exit code 2 and these words.
fn refused(done: &Out, words: &[&str]) {
    assert_eq!(done.code, 2, "{}", done.stderr);
    for word in words {
        assert!(done.stderr.contains(word), "{word}: {}", done.stderr);
    }
}

#[test]
fn wrong_arguments_and_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let m01 = case("m01/case.yaml");
    let m01 = m01.to_str().unwrap();
    let done = explain(&out, &[m01, "--without", "coulomb"]);
    refused(
        &done,
        &["no effect `coulomb`", "did you mean `coulomb_friction`?"],
    );
    refused(&explain(&out, &[]), &["CASE"]);

    let (robot_file, recording) = (robot("six"), case("m01/rec_00.mcap"));
    let (robot_file, recording) = (robot_file.to_str().unwrap(), recording.to_str().unwrap());
    let done = explain(&out, &["--robot", robot_file, "--fit", recording]);
    refused(&done, &["rec_00.mcap: no joint state names yaw"]);
    let done = explain(
        &out,
        &[
            "--robot",
            robot_file,
            "--fit",
            recording,
            "--holdout",
            recording,
        ],
    );
    refused(&done, &["named twice"]);
    let done = explain(&out, &["--fit", recording]);
    refused(&done, &["--robot URDF"]);

    let text = "case: x\nrobot: none.urdf\nfit: [a.mcap]\nefort_unit: A\n";
    let file = write(&folder.path().join("case.yaml"), text);
    refused(
        &explain_case(&out, &file),
        &["did you mean `effort_unit`?", "case.yaml:4"],
    );
    let file = write(
        &folder.path().join("case.yaml"),
        &text.replace("efort_unit: A\n", ""),
    );
    refused(
        &explain_case(&out, &file),
        &["case.yaml:2", "case.yaml:3", "no recording"],
    );
    assert!(!out.exists());
}

#[test]
fn a_joint_that_is_never_a_number_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let never = changed(folder.path(), "m01", &["rec_01"], |_, state| {
        state.effort[3] = f64::NAN;
    });
    let out = folder.path().join("out");
    refused(&explain_case(&out, &never), &["rec_01", "NaN throughout"]);
}

#[test]
fn what_it_reads_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let m01 = case("m01/case.yaml");
    let out = folder.path().join("out");
    let done = explain_case(&out, &m01);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let text = std::fs::read_to_string(&m01).unwrap();
    let here = root().join("tests/proof/set");
    let text = text
        .replace("../../robots", here.join("robots").to_str().unwrap())
        .replace("rec_", here.join("cases/m01/rec_").to_str().unwrap());
    let text = format!("{text}twin: {{model: out/twin.yaml}}\n");
    let again = write(&folder.path().join("case.yaml"), &text);
    refused(&explain_case(&out, &again), &["would overwrite"]);
    // In another folder it succeeds: nothing has changed since.
    let other = folder.path().join("other");
    let done = explain_case(&other, &again);
    assert_eq!(done.code, 0, "{}", done.stderr);
    assert_eq!(report(&other)["verdict"], "nothing_missing");
    let twin = |out: &Path| std::fs::read_to_string(out.join("twin.yaml")).unwrap();
    let terms = |text: String| {
        text.split("scores:")
            .next()
            .unwrap()
            .split("terms:")
            .nth(1)
            .map(str::to_owned)
    };
    assert_eq!(terms(twin(&out)), terms(twin(&other)));
}
