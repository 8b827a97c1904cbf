//! Pushes on an arm at rest.

use std::path::Path;

use serde_json::Value;
use tauscope_archive::ros::{Header, JointState};

use super::{STATES, explain, record, report, robot};

/// Writes a recording of an arm at rest that is pushed at a link with these forces at these times \[s\].
fn pushed(path: &Path, robot: &Path, link: &str, pushes: &[(f64, f64, [f64; 3])]) {
    use tauscope_dynamics::{Data, Model, forward_kinematics, gravity_effort, link_jacobian};
    let model = Model::from_urdf(&std::fs::read_to_string(robot).unwrap()).unwrap();
    let mut data = Data::new(&model);
    let position = [0.4, -0.7, 0.9, 0.3, -0.6, 0.2];
    let load = gravity_effort(&model, &mut data, &position).to_vec();
    forward_kinematics(&model, &mut data, &position);
    let link = model.link_index(link).unwrap();
    let jacobian = link_jacobian(&model, &mut data, link).clone();
    let names: Vec<String> = model.joint_names().map(str::to_owned).collect();
    let rows: Vec<(i64, JointState)> = (0..1200_u32)
        .map(|k| {
            let t = 0.01 * f64::from(k);
            let noise = |j: usize| 0.02 * (f64::from(k) * (1.7 + j as f64)).sin();
            let mut effort: Vec<f64> = (0..6).map(|j| load[j] + 0.3 + noise(j)).collect();
            for (from, to, force) in pushes {
                // The force grows and fades.
                let share = ((t - from) / (to - from)).clamp(0.0, 1.0);
                let now = (std::f64::consts::PI * share).sin();
                for (j, effort) in effort.iter_mut().enumerate() {
                    let torque: f64 = (0..3).map(|axis| jacobian[(axis, j)] * force[axis]).sum();
                    *effort -= now * torque;
                }
            }
            let time_ns = 1_000_000_000 + i64::from(k) * 10_000_000;
            let state = JointState {
                header: Header::new(time_ns, ""),
                name: names.clone(),
                position: position.map(|q| q + 1e-5 * noise(3)).to_vec(),
                velocity: Vec::new(),
                effort,
            };
            (time_ns, state)
        })
        .collect();
    record(path, &[(STATES, &rows)]);
}

/// Report on one recording of a robot.
fn explained(out: &Path, robot: &Path, recording: &Path) -> Value {
    let (robot, recording) = (robot.to_str().unwrap(), recording.to_str().unwrap());
    let done = explain(out, &["--robot", robot, "--fit", recording]);
    assert_eq!(done.code, 0, "{}", done.stderr);
    report(out)
}

#[test]
fn pushes_on_an_arm_at_rest_are_told_in_time_and_place() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, recording) = (robot("six"), folder.path().join("pushed.mcap"));
    let pushes = [
        // Within the first second, whose load is part of the baseline.
        (0.5, 1.2, [15.0, 5.0, -10.0]),
        (5.0, 5.8, [-8.0, 12.0, 6.0]),
        (8.0, 9.0, [3.0, -20.0, 9.0]),
    ];
    pushed(&recording, &robot, "fore", &pushes);
    let out = folder.path().join("out");
    let report = explained(&out, &robot, &recording);
    assert_eq!(report["verdict"], "explained", "{report:#}");
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len(), pushes.len(), "{report:#}");
    let mut starts: Vec<f64> = Vec::new();
    for finding in findings {
        assert_eq!(finding["effect"], "external_push");
        let link = finding["link"].as_str().unwrap();
        assert!(["upper", "fore", "wrist_a"].contains(&link), "{link}");
        starts.push(finding["t_start"].as_f64().unwrap());
    }
    starts.sort_by(f64::total_cmp);
    for (start, (from, to, _)) in starts.iter().zip(pushes) {
        assert!(
            *start >= from - 0.1 && *start < 0.5 * (from + to),
            "{start}"
        );
    }
}

#[test]
fn a_push_that_only_the_first_joint_feels_is_told_near_it_and_without_a_force() {
    let folder = tempfile::tempdir().unwrap();
    let (robot, recording) = (robot("six"), folder.path().join("aside.mcap"));
    // Along the axes of lift and elbow, in the pose of `pushed`: the frames of the first two links lie on the axis of turn.
    let (sin, cos) = 0.4_f64.sin_cos();
    let aside = [-20.0 * sin, 20.0 * cos, 0.0];
    pushed(&recording, &robot, "fore", &[(3.0, 4.0, aside)]);
    let out = folder.path().join("out");
    let report = explained(&out, &robot, &recording);
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "{report:#}");
    assert_eq!(findings[0]["effect"], "external_push");
    let link = findings[0]["link"].as_str().unwrap();
    assert!(["turret", "upper"].contains(&link), "{link}");
    let sentence = findings[0]["sentence"].as_str().unwrap();
    let force = findings[0]["parameters"].get("force_x_n");
    assert!(
        force.is_none() && sentence.contains("neither the force"),
        "{report:#}"
    );
}
