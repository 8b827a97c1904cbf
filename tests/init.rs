//! `tauscope init`: from contact-free recordings to a pipeline that finds contacts.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::ffi::OsStr;
use std::path::Path;

use crate::common::{Out, bundled, root};
use serde_json::Value;

const FREE: [&str; 3] = [
    "demo_train_points.mcap",
    "demo_train_sweep.mcap",
    "demo_validation.mcap",
];

fn init(out: &Path, more: &[&str]) -> Out {
    let free = FREE.map(|name| bundled().join(name));
    let robot = bundled().join("demo_arm.urdf");
    let mut arguments: Vec<&OsStr> = vec!["init".as_ref()];
    arguments.extend(free.iter().map(|path| path.as_os_str()));
    arguments.extend(["--robot".as_ref(), robot.as_os_str()]);
    arguments.extend(["--out".as_ref(), out.as_os_str()]);
    arguments.extend(more.iter().map(OsStr::new));
    Out::answer(arguments)
}

/// The contacts that a replay of the bundled recording finds: link and stamps.
fn found(pipeline: &Path, out: &Path) -> Vec<(f64, f64)> {
    let demo = bundled().join("demo.mcap");
    let replayed = Out::answer(
        ["replay".as_ref(), demo.as_os_str()]
            .into_iter()
            .chain(["--pipeline".as_ref(), pipeline.as_os_str()])
            .chain(["--out".as_ref(), out.as_os_str(), "--json".as_ref()]),
    );
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    let summary: Value = serde_json::from_str(&replayed.stdout).unwrap();
    let mut events = Vec::new();
    collect(&summary, &mut events);
    events
}

fn collect(value: &Value, events: &mut Vec<(f64, f64)>) {
    match value {
        Value::Object(map) => {
            for event in map
                .get("events")
                .and_then(Value::as_array)
                .into_iter()
                .flatten()
            {
                let stamp = |key: &str| event[key].as_f64().unwrap();
                events.push((stamp("t_contact"), stamp("t_off")));
            }
            map.values().for_each(|value| collect(value, events));
        }
        Value::Array(items) => items.iter().for_each(|value| collect(value, events)),
        _ => {}
    }
}

#[test]
fn three_free_recordings_make_a_pipeline_that_finds_every_push() {
    let folder = tempfile::tempdir().unwrap();
    let cell = folder.path().join("cell");
    let out = init(&cell, &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
    assert!(
        out.stdout.contains("in N m: on joints that carry weight"),
        "{}",
        out.stdout
    );
    assert!(out.stdout.contains("Coulomb friction"), "{}", out.stdout);
    assert!(out.stdout.contains("0 false alarms"), "{}", out.stdout);

    let checked = Out::answer(["check".as_ref(), cell.join("pipeline.yaml").as_os_str()]);
    assert_eq!(checked.code, 0, "{}", checked.stderr);

    // As its comment says, for the robot itself.
    let text = std::fs::read_to_string(cell.join("pipeline.yaml")).unwrap();
    let live = text
        .replace("      file: ", "      # file: ")
        .replace("      # zenoh: ", "      zenoh: ");
    assert_ne!(live, text);
    std::fs::write(cell.join("live.yaml"), live).unwrap();
    let checked = Out::answer(["check".as_ref(), cell.join("live.yaml").as_os_str()]);
    assert_eq!(checked.code, 0, "{}", checked.stderr);

    let labels = std::fs::read_to_string(bundled().join("labels.json")).unwrap();
    let labels: Value = serde_json::from_str(&labels).unwrap();
    let pushes = labels["recordings"]["demo"]["events"].as_array().unwrap();
    let events = found(&cell.join("pipeline.yaml"), &folder.path().join("results"));
    assert_eq!(events.len(), pushes.len(), "{events:?}");
    for (push, (from, to)) in pushes.iter().zip(&events) {
        let (on, off) = (
            push["t_on"].as_f64().unwrap(),
            push["t_off"].as_f64().unwrap(),
        );
        assert!(*from < off && *to > on, "{push} is not {from} to {to}");
    }

    let again = init(&cell, &[]);
    assert_eq!(again.code, 2, "{}", again.stdout);
    assert!(
        again.stderr.contains("already") && again.stderr.contains("--force"),
        "{}",
        again.stderr
    );
}

#[test]
fn the_wrong_unit_is_refused_with_the_right_one() {
    let folder = tempfile::tempdir().unwrap();
    let free = amperes(folder.path());
    let robot = bundled().join("demo_arm.urdf");
    let calibrate = |unit: &str| {
        Out::answer(
            [
                "calibrate".as_ref(),
                free.as_os_str(),
                "--robot".as_ref(),
                robot.as_os_str(),
            ]
            .into_iter()
            .chain(["--effort-unit".as_ref(), unit.as_ref()])
            .chain([
                "--out".as_ref(),
                folder.path().join(format!("{unit}.yaml")).as_os_str(),
            ]),
        )
    };
    let wrong = calibrate("Nm");
    assert_eq!(wrong.code, 2, "{}", wrong.stdout);
    assert!(wrong.stderr.contains("--effort-unit A"), "{}", wrong.stderr);
    assert!(!folder.path().join("Nm.yaml").exists());
    assert_eq!(calibrate("A").code, 0);
}

#[test]
fn another_robot_is_refused_with_the_joints_that_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(bundled().join("demo_arm.urdf")).unwrap();
    let other = folder.path().join("other.urdf");
    std::fs::write(&other, urdf.replace("\"joint4\"", "\"elbow\"")).unwrap();
    let free = [FREE[0], FREE[1]].map(|name| bundled().join(name));
    let out = Out::answer(
        [
            "init".as_ref(),
            free[0].as_os_str(),
            free[1].as_os_str(),
            "--robot".as_ref(),
            other.as_os_str(),
        ]
        .into_iter()
        .chain(["--out".as_ref(), folder.path().join("cell").as_os_str()]),
    );
    assert_eq!(out.code, 2, "{}", out.stdout);
    assert!(
        out.stderr.contains("elbow") && out.stderr.contains("joint4"),
        "{}",
        out.stderr
    );
}

#[test]
fn the_bundled_pipeline_is_what_init_makes() {
    let pipeline = root().join("pipeline.yaml");
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(found(&pipeline, folder.path()).len(), 6);
}

/// A bundled recording with its efforts as currents, of 10 N m/A.
fn amperes(folder: &Path) -> std::path::PathBuf {
    use tauscope_archive::ros::JointState;
    use tauscope_archive::{Compression, McapWriter, Recording};

    let recording = Recording::open(bundled().join(FREE[0])).unwrap();
    let path = folder.join("amperes.mcap");
    let none = std::collections::BTreeMap::new();
    let mut writer = McapWriter::create(&path, Compression::Zstd, &none).unwrap();
    let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    while let Some(state) = states.next_state() {
        let state = state.unwrap();
        let mut message = state.message.clone();
        for effort in &mut message.effort {
            *effort /= 10.0;
        }
        let ns = message.header.stamp.ns();
        writer.write(topic, ns, ns, &message).unwrap();
    }
    writer.finish().unwrap();
    path
}

#[test]
fn the_topic_with_positions_is_taken() {
    use tauscope_archive::ros::JointState;
    use tauscope_archive::{Compression, McapWriter, Recording};

    let folder = tempfile::tempdir().unwrap();
    let free = FREE.map(|name| {
        let recording = Recording::open(bundled().join(name)).unwrap();
        let path = folder.path().join(name);
        let none = std::collections::BTreeMap::new();
        let mut writer = McapWriter::create(&path, Compression::Zstd, &none).unwrap();
        let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
        let sensors = writer.add_topic::<JointState>("/joint_torques").unwrap();
        let mut states = recording.joint_states("/joint_states").unwrap();
        while let Some(state) = states.next_state() {
            let mut message = state.unwrap().message.clone();
            let ns = message.header.stamp.ns();
            writer.write(topic, ns, ns, &message).unwrap();
            message.position.clear();
            message.velocity.clear();
            writer.write(sensors, ns, ns, &message).unwrap();
        }
        writer.finish().unwrap();
        path
    });
    let robot = bundled().join("demo_arm.urdf");
    let cell = folder.path().join("cell");
    let mut arguments: Vec<&OsStr> = vec!["init".as_ref()];
    arguments.extend(free.iter().map(|path| path.as_os_str()));
    arguments.extend(["--robot".as_ref(), robot.as_os_str()]);
    arguments.extend(["--out".as_ref(), cell.as_os_str()]);
    let out = Out::answer(arguments);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let text = std::fs::read_to_string(cell.join("init.md")).unwrap();
    assert!(text.contains("on /joint_states in"), "{text}");
}

#[test]
fn what_fails_half_way_leaves_nothing_and_can_be_repeated() {
    use tauscope_archive::ros::JointState;
    use tauscope_archive::{Compression, McapWriter, Recording};

    let folder = tempfile::tempdir().unwrap();
    let robot = bundled().join("demo_arm.urdf");
    let cell = folder.path().join("cell");
    let short = |name: &str| {
        let recording = Recording::open(bundled().join(name)).unwrap();
        let path = folder.path().join(name);
        let none = std::collections::BTreeMap::new();
        let mut writer = McapWriter::create(&path, Compression::Zstd, &none).unwrap();
        let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
        let mut states = recording.joint_states("/joint_states").unwrap();
        for _ in 0..160 {
            let message = states.next_state().unwrap().unwrap().message.clone();
            let ns = message.header.stamp.ns();
            writer.write(topic, ns, ns, &message).unwrap();
        }
        writer.finish().unwrap();
        path
    };
    let (one, two) = (short(FREE[0]), short(FREE[1]));
    let arguments: Vec<&OsStr> = vec![
        "init".as_ref(),
        one.as_os_str(),
        two.as_os_str(),
        "--robot".as_ref(),
        robot.as_os_str(),
        "--effort-unit".as_ref(),
        "Nm".as_ref(),
        "--out".as_ref(),
        cell.as_os_str(),
    ];
    // A process of its own: what is to be undone is kept once for a process, and other tests set up cells in this one.
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_tauscope"));
    command.args(arguments);
    let failed = Out::of(command);
    assert_eq!(failed.code, 2, "{}{}", failed.stdout, failed.stderr);
    assert!(!cell.exists(), "{}", failed.stderr);
    let out = init(&cell, &[]);
    assert_eq!(out.code, 0, "{}", out.stderr);
}
