//! Corrections in simulators' own files: from a MuJoCo model and recordings to a corrected model in one command, and `export`.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::{Path, PathBuf};

use tauscope_dynamics::{Data, rnea};
use tauscope_session::robot;

use crate::common::{Out, root, write};

/// Additional dry friction at the shoulder \[N m\] and viscous friction at the elbow \[N m s/rad\].
const MORE: [f64; 2] = [2.5, 1.25];

/// Recordings of an arm that has more friction than its model says.
fn recordings(folder: &Path, model: &Path) -> Vec<PathBuf> {
    let model = robot::read(model).unwrap().model;
    let (mut data, mut seed) = (Data::new(&model), 7_u64);
    let mut noise = move || {
        let sum = (0..12).map(|_| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 33) as f64 / 2_f64.powi(31)
        });
        sum.sum::<f64>() - 6.0
    };
    let mut all = Vec::new();
    for k in 0..4 {
        let names = ["shoulder", "elbow", "roll"];
        let head = names.map(|name| format!("{name}.position,{name}.velocity,{name}.effort"));
        let mut text = format!("time,{}\n", head.join(","));
        for row in 0..1200 {
            let t = 0.01 * f64::from(row);
            let wave = |j: usize| {
                let (rate, phase) = (
                    0.7 + 0.3 * j as f64 + 0.21 * f64::from(k),
                    f64::from(k) + j as f64,
                );
                let (slow, fast) = (rate * t + phase, 2.7 * rate * t);
                let (a, b, c) = (rate, 2.7 * rate, [0.0, -1.2, 0.0][j]);
                [
                    c + 0.6 * slow.sin() + 0.15 * fast.sin(),
                    0.6 * a * slow.cos() + 0.15 * b * fast.cos(),
                    -0.6 * a * a * slow.sin() - 0.15 * b * b * fast.sin(),
                ]
            };
            let motion = [0, 1, 2].map(wave);
            let [q, qd, qdd] = [0, 1, 2].map(|d| motion.map(|of| of[d]));
            let mut effort = rnea(&model, &mut data, &q, &qd, &qdd).to_vec();
            for (joint, effort) in model.joints().iter().zip(&mut effort) {
                let at = model.joint_index(&joint.name).unwrap();
                let drive = joint.drive;
                *effort += drive.damping * qd[at] + drive.friction * qd[at].signum();
                *effort += drive.rotor_inertia * qdd[at] + 0.01 * noise();
            }
            effort[0] += MORE[0] * qd[0].signum();
            effort[1] += MORE[1] * qd[1];
            let cells = (0..3).map(|j| format!("{},{},{}", q[j], qd[j], effort[j]));
            text += &format!("{t},{}\n", cells.collect::<Vec<_>>().join(","));
        }
        all.push(write(&folder.join(format!("rec_{k}.csv")), &text));
    }
    all
}

fn models() -> PathBuf {
    root().join("tests/simulators/models")
}

fn export(report: &Path, to: &str, model: Option<&Path>, out: &Path) -> Out {
    let mut arguments = vec![
        "export".into(),
        report.as_os_str().to_owned(),
        "--to".into(),
        to.into(),
    ];
    if let Some(model) = model {
        arguments.extend(["--model".into(), model.as_os_str().to_owned()]);
    }
    arguments.extend(["--out".into(), out.as_os_str().to_owned()]);
    Out::answer(arguments)
}

#[test]
fn a_mujoco_model_and_recordings_make_a_corrected_model_in_one_command() {
    let folder = tempfile::tempdir().unwrap();
    let model = models().join("folded.xml");
    let recordings = recordings(folder.path(), &model);
    let report = folder.path().join("report");
    let mut arguments = vec!["explain".into()];
    arguments.extend(recordings.iter().map(|path| path.as_os_str().to_owned()));
    arguments.extend(["--robot".into(), model.as_os_str().to_owned()]);
    arguments.extend(["--out".into(), report.as_os_str().to_owned()]);
    let done = Out::answer(arguments);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let path = report.join("robot.xml");
    let before = robot::read(&model).unwrap().model;
    let after = robot::read(&path).unwrap().model;
    let drive = |model: &tauscope_dynamics::Model, name: &str| {
        model.joints()[model.joint_index(name).unwrap()].drive
    };
    let more = drive(&after, "shoulder").friction - drive(&before, "shoulder").friction;
    assert!((more - MORE[0]).abs() < 0.1, "{more} {}", done.stdout);
    let more = drive(&after, "elbow").damping - drive(&before, "elbow").damping;
    assert!((more - MORE[1]).abs() < 0.1, "{more} {}", done.stdout);
    // The other joint stays as it was written.
    assert_eq!(drive(&after, "roll"), drive(&before, "roll"));
    assert!((drive(&after, "elbow").friction - 0.8).abs() < 1e-12);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("Corrected by tauscope.\nWritten:\n"),
        "{text}"
    );

    // Other simulators get the same corrections. An actuator configuration needs no file.
    let isaac = folder.path().join("isaac.py");
    let done = export(&report, "isaaclab", None, &isaac);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let text = std::fs::read_to_string(&isaac).unwrap();
    assert!(
        text.contains("\"shoulder\": ImplicitActuatorCfg("),
        "{text}"
    );
    // In a URDF of the model the whole friction is written, for nothing of it was stated there.
    let urdf = folder.path().join("robot.urdf");
    let done = export(&report, "urdf", None, &urdf);
    assert_eq!(done.code, 0, "{}", done.stderr);
    let text = std::fs::read_to_string(&urdf).unwrap();
    let number = |joint: &str, attribute: &str| {
        let document = roxmltree::Document::parse(&text).unwrap();
        let mut all = document.descendants();
        let node =
            all.find(|node| node.has_tag_name("joint") && node.attribute("name") == Some(joint));
        let mut children = node.unwrap().children();
        let dynamics = children.find(|node| node.has_tag_name("dynamics")).unwrap();
        dynamics
            .attribute(attribute)
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    for (joint, drive) in after
        .joints()
        .iter()
        .map(|joint| (&joint.name, joint.drive))
    {
        assert!(
            (number(joint, "friction") - drive.friction).abs() < 1e-9,
            "{joint}: {text}"
        );
        assert!(
            (number(joint, "damping") - drive.damping).abs() < 1e-9,
            "{joint}: {text}"
        );
    }
    assert!(!text.contains("mujoco"), "{text}");
    let done = export(&report, "mjcf", None, &model);
    assert_eq!(done.code, 2, "the input would be lost: {}", done.stdout);
    let done = export(&report, "gazebo", None, &isaac);
    assert!(
        done.stderr.contains("urdf, mjcf, sdf, isaaclab, drake"),
        "{}",
        done.stderr
    );
}

#[test]
fn a_folder_without_corrections_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let done = export(folder.path(), "mjcf", None, &folder.path().join("out.xml"));
    assert_eq!(done.code, 2, "{}", done.stdout);
    assert!(done.stderr.contains("twin.yaml"), "{}", done.stderr);
}
