//! `tauscope explain` as a program: its findings on arms with known hidden physics, its output files, and bad input
//! (`bad_input.rs`).

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod at_rest;
mod bad_input;
mod changed;
mod simulated;

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use crate::common::{Out, root, tauscope, write};
use serde_json::Value;
use tauscope_archive::ros::JointState;
use tauscope_archive::{Compression, McapWriter, Recording};

const STATES: &str = "/joint_states";

/// A case of the small set, simulated by another engine.
fn case(name: &str) -> PathBuf {
    root().join("tests/proof/set/cases").join(name)
}

fn robot(name: &str) -> PathBuf {
    let file = format!("tests/proof/set/robots/{name}.urdf");
    root().join(file)
}

/// Runs `tauscope explain` with these arguments, with its results in `out`.
fn explain(out: &Path, arguments: &[&str]) -> Out {
    let arguments = ["explain", "--force"]
        .iter()
        .chain(arguments)
        .map(OsStr::new);
    Out::answer(arguments.chain(["--out".as_ref(), out.as_os_str()]))
}

/// Runs it on a case file.
fn explain_case(out: &Path, case: &Path) -> Out {
    explain(out, &[case.to_str().unwrap()])
}

fn report(out: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap()
}

/// Effect and place of every finding.
fn named(report: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().map(str::to_owned);
    let mut all: Vec<_> = report["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|finding| {
            let place = text(&finding["joint"]).or_else(|| text(&finding["link"]));
            (text(&finding["effect"]).unwrap(), place.unwrap_or_default())
        })
        .collect();
    all.sort();
    all
}

fn pair(effect: &str, place: &str) -> (String, String) {
    (effect.to_owned(), place.to_owned())
}

/// Every joint state of a recording with its log time [ns].
fn states(recording: &Path) -> Vec<(i64, JointState)> {
    let recording = Recording::open(recording).unwrap();
    let mut states = recording.joint_states(STATES).unwrap();
    let mut all = Vec::new();
    while let Some(state) = states.next_state() {
        let state = state.unwrap();
        all.push((state.log_time_ns, state.message.clone()));
    }
    all
}

/// Writes topics of joint states.
fn record(path: &Path, topics: &[(&str, &[(i64, JointState)])]) {
    let mut writer = McapWriter::create(path, Compression::None, &BTreeMap::new()).unwrap();
    for (name, states) in topics {
        let topic = writer.add_topic::<JointState>(name).unwrap();
        for (log_ns, state) in *states {
            writer.write(topic, *log_ns, *log_ns, state).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Copies `name`'s case into `folder` with every row of the recordings in `which` changed; an empty `which` means
/// all. The function receives the row number.
fn changed(
    folder: &Path,
    name: &str,
    which: &[&str],
    change: impl Fn(usize, &mut JointState),
) -> PathBuf {
    let from = case(name);
    for entry in std::fs::read_dir(&from).unwrap() {
        let path = entry.unwrap().path();
        let to = folder.join(path.file_name().unwrap());
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.extension().is_none_or(|ending| ending != "mcap") {
            continue;
        }
        if which.is_empty() || which.contains(&stem.as_str()) {
            let mut states = states(&path);
            for (row, (_, state)) in states.iter_mut().enumerate() {
                change(row, state);
            }
            record(&to, &[(STATES, &states)]);
        } else {
            std::fs::copy(&path, &to).unwrap();
        }
    }
    let text = std::fs::read_to_string(from.join("case.yaml")).unwrap();
    let robots = root().join("tests/proof/set/robots");
    let text = text.replace("../../robots", robots.to_str().unwrap());
    write(&folder.join("case.yaml"), &text)
}

#[test]
fn a_viscous_joint_is_named_and_everything_is_left_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let done = explain_case(&out, &case("m01/case.yaml"));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(&out);
    assert_eq!(report["verdict"], "explained");
    assert_eq!(named(&report), [pair("viscous_friction", "roll")]);
    assert!(done.stdout.contains("viscous_friction"), "{}", done.stdout);
    // The interval contains the concealed value, and the error falls to the noise.
    let finding = &report["findings"][0];
    let found = finding["parameters"]["viscous_nms_per_rad"]
        .as_f64()
        .unwrap();
    assert!((found - 1.9236).abs() < 0.02, "{found}");
    let rms = |key: &str| report[key][5].as_f64().unwrap();
    assert!(rms("holdout_rms_after") < 0.05 * rms("holdout_rms_before"));
    // One row per recorded row, one column per joint, all finite; the reported error agrees with them.
    assert_eq!(report["holdout_predictions"]["rec_03"], "rec_03.csv");
    let rows: Vec<Vec<f64>> = std::fs::read_to_string(out.join("rec_03.csv"))
        .unwrap()
        .lines()
        .map(|line| {
            line.split(',')
                .map(|field| field.parse().unwrap())
                .collect()
        })
        .collect();
    let measured = states(&case("m01/rec_03.mcap"));
    assert_eq!(rows.len(), measured.len());
    let joints: Vec<&str> = report["joints"]
        .as_array()
        .unwrap()
        .iter()
        .map(|j| j.as_str().unwrap())
        .collect();
    let mut squares = vec![0.0; joints.len()];
    for (row, (_, state)) in rows.iter().zip(&measured) {
        assert_eq!(row.len(), joints.len());
        for (j, joint) in joints.iter().enumerate() {
            let at = state.name.iter().position(|name| name == joint).unwrap();
            squares[j] += (state.effort[at] - row[j]).powi(2);
        }
    }
    for (j, squares) in squares.iter().enumerate() {
        let rms = (squares / rows.len() as f64).sqrt();
        let said = report["holdout_rms_after"][j].as_f64().unwrap();
        assert!(
            (rms - said).abs() < 1e-6,
            "{}: {rms}, said {said}",
            joints[j]
        );
    }
    // Friction cannot be stored in a robot's description of bodies.
    assert!(!out.join("robot.urdf").exists());
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("roll") && !page.contains("<script"));
}

#[test]
fn the_corrected_twin_is_one_that_a_pipeline_loads_and_it_is_better() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let done = explain_case(&out, &case("m01/case.yaml"));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let recording = case("m01/rec_03.mcap");
    let residual = |model: &str| {
        let text = format!(
            "version: 1\ncells: {{arm: {{robot: {}}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {}}}}}}}\n\
             - {{name: twin, input: ingest, twin: {{{model}}}}}\n",
            robot("slide").display(),
            recording.display(),
        );
        let pipeline = write(&folder.path().join("pipeline.yaml"), &text);
        let mut command = tauscope();
        command
            .arg("replay")
            .arg("--json")
            .arg("--pipeline")
            .arg(pipeline);
        let done = Out::of({
            command.arg(&recording);
            command
        });
        assert_eq!(done.code, 0, "{}", done.stderr);
        let summary: Value = serde_json::from_str(&done.stdout).unwrap();
        // In URDF order: the rail, the arm, the roll at its end.
        let joints = &summary[0]["twins"][0]["joints"];
        joints[5]["residual_rms"].as_f64().unwrap()
    };
    let model = format!("model: {}", out.join("twin.yaml").display());
    let (before, after) = (residual(""), residual(&model));
    assert!(after < 0.2 * before, "{before} {after}");
}

#[test]
fn a_payload_in_amperes_is_weighed_and_is_in_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let done = explain_case(&out, &case("m02/case.yaml"));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(&out);
    assert_eq!(named(&report), [pair("payload", "tool")]);
    let mass = report["findings"][0]["parameters"]["mass_kg"]
        .as_f64()
        .unwrap();
    assert!((mass - 0.6661).abs() < 0.02, "{mass}");
    let urdf = std::fs::read_to_string(out.join("robot.urdf")).unwrap();
    let original = std::fs::read_to_string(robot("seven")).unwrap();
    let tool = |text: &str| {
        let model = tauscope_dynamics::Model::from_urdf(text).unwrap();
        model.links()[model.link_index("tool").unwrap()].mass_kg()
    };
    assert!((tool(&urdf) - tool(&original) - mass).abs() < 1e-9);
}

#[test]
fn drives_nobody_knows_are_scaled_by_gravity_and_inertia_within_their_intervals() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let copy = changed(folder.path(), "m00", &[], |_, _| {});
    let text = std::fs::read_to_string(&copy).unwrap();
    let constants = text.find("torque_constants_nm_per_a:").unwrap();
    let known: BTreeMap<String, f64> = text[constants..]
        .lines()
        .skip(1)
        .map_while(|line| line.strip_prefix("  ")?.split_once(": "))
        .map(|(joint, value)| (joint.to_owned(), value.parse().unwrap()))
        .collect();
    let kept = |line: &&str| {
        !line.starts_with("torque_constants")
            && !known
                .keys()
                .any(|joint| line.starts_with(&format!("  {joint}: ")))
    };
    let without: Vec<&str> = text.lines().filter(kept).collect();
    write(&copy, &without.join("\n"));
    let done = explain_case(&out, &copy);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(&out);
    assert_eq!(named(&report), [pair("stribeck_friction", "lift")]);
    let notes: Vec<&str> = report["notes"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_str)
        .collect();
    // The interval of each drive contains the true value.
    for (joint, constant) in &known {
        let start = format!("The drive of joint {joint} has ");
        let note = notes.iter().find(|note| note.starts_with(&start));
        let (_, ends) = note.unwrap().split_once("interval ").unwrap();
        let ends = ends.trim_end_matches(").").split(" to ");
        let ends: Vec<f64> = ends.map(|end| end.parse().unwrap()).collect();
        assert!(
            ends[0] < *constant && *constant < ends[1],
            "{joint} {constant}: {ends:?}"
        );
    }
    // The numbers of lift are in N m although the recordings are in A.
    let finding = &report["findings"][0];
    let coulomb_nm = finding["parameters"]["coulomb_nm"].as_f64().unwrap();
    let interval = finding["intervals_95"]["coulomb_nm"].as_array().unwrap();
    let ends: Vec<f64> = interval.iter().filter_map(Value::as_f64).collect();
    assert!(ends[0] < 4.188 && 4.188 < ends[1], "{coulomb_nm} {ends:?}");
}

#[test]
fn a_joint_with_dry_and_viscous_friction_keeps_both_names() {
    let folder = tempfile::tempdir().unwrap();
    let robot = root().join("tests/data/demo_arm.urdf");
    let scenario = folder.path().join("two.yaml");
    let text = format!(
        "version: 1
robot: {}
seed: 3
rate_hz: 125
physics:
  - {{effect: coulomb_friction, joint: joint2, parameters: {{coulomb_nm: 1.8}}}}
  - {{effect: viscous_friction, joint: joint2, parameters: {{viscous_nms_per_rad: 2.6}}}}
sensors: {{effort_noise_nm: 0.08}}
recordings:
  - {{name: r0, duration_s: 8, motion: {{fourier: {{period_s: 8, harmonics: 4}}}}}}
  - {{name: r1, duration_s: 8, motion: {{points: {{speed: 0.4, rest_s: [0.2, 0.8]}}}}}}
  - {{name: r2, duration_s: 8, motion: {{fourier: {{period_s: 8, harmonics: 5}}}}}}
",
        robot.display()
    );
    write(&scenario, &text);
    let mut simulate = tauscope();
    simulate.arg("simulate").arg(&scenario).arg("--force");
    simulate.arg("--out").arg(folder.path());
    let done = Out::of(simulate);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let of = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let out = folder.path().join("out");
    let [r0, r1, r2] = ["r0.mcap", "r1.mcap", "r2.mcap"].map(of);
    let robot = robot.to_str().unwrap();
    let done = explain(
        &out,
        &["--robot", robot, "--fit", &r0, &r1, "--holdout", &r2],
    );
    assert_eq!(done.code, 0, "{}", done.stderr);
    let both = ["coulomb_friction", "viscous_friction"].map(|effect| pair(effect, "joint2"));
    assert_eq!(named(&report(&out)), both);
}

#[test]
fn nothing_is_missing_where_nothing_was_concealed() {
    let folder = tempfile::tempdir().unwrap();
    let done = explain_case(folder.path(), &case("m11/case.yaml"));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(folder.path());
    assert_eq!(report["verdict"], "nothing_missing");
    assert_eq!(named(&report), []);
}

#[test]
fn a_prediction_comes_from_the_motion_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    let done = explain_case(&first, &case("m01/case.yaml"));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let emptied = changed(folder.path(), "m01", &["rec_03"], |_, state| {
        state.effort.clear();
    });
    let done = explain_case(&second, &emptied);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let prediction = |out: &Path| std::fs::read(out.join("rec_03.csv")).unwrap();
    assert!(prediction(&first) == prediction(&second));
    assert!(report(&second)["holdout_rms_after"][0].is_null());
}

#[test]
fn a_twin_on_a_topic_is_explained_without_a_robot() {
    let folder = tempfile::tempdir().unwrap();
    // A given twin that contains everything except the friction of `turn`.
    let mut files = Vec::new();
    for name in ["rec_00", "rec_01", "rec_02", "rec_03"] {
        let measured = states(&case("m11").join(format!("{name}.mcap")));
        let mut seed = 1_u32;
        let twin: Vec<(i64, JointState)> = measured
            .iter()
            .map(|(log_ns, state)| {
                let mut twin = state.clone();
                for (at, joint) in state.name.iter().enumerate() {
                    // Independent noise: a sum of uniform numbers.
                    let mut noise = 0.0;
                    for _ in 0..4 {
                        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                        noise += f64::from(seed >> 8) / f64::from(1 << 24) - 0.5;
                    }
                    twin.effort[at] += 0.05 * noise;
                    if joint == "turn" {
                        twin.effort[at] -= 3.0 * state.velocity[at];
                    }
                }
                (*log_ns, twin)
            })
            .collect();
        let path = folder.path().join(format!("{name}.mcap"));
        record(&path, &[(STATES, &measured), ("/twin/joint_states", &twin)]);
        files.push(path.to_str().unwrap().to_owned());
    }
    let out = folder.path().join("out");
    let mut arguments = vec!["--twin-topic", "/twin/joint_states", "--fit"];
    arguments.extend(files[..3].iter().map(String::as_str));
    arguments.extend(["--holdout", &files[3]]);
    let done = explain(&out, &arguments);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let report = report(&out);
    assert_eq!(named(&report), [pair("viscous_friction", "turn")]);
    let found = report["findings"][0]["parameters"]["viscous_nms_per_rad"]
        .as_f64()
        .unwrap();
    assert!((found - 3.0).abs() < 0.1, "{found}");
}
