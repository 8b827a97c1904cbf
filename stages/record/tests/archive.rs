//! The recorder archives exactly its input.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]
#![allow(clippy::float_cmp, reason = "the archive keeps every bit")]

use std::collections::BTreeMap;
use std::path::Path;

use crate::synthetic::{Instant, START_NS, STEP_NS, THRESHOLD, arm, cell, motion, streams};
use tauscope_archive::Recording;
use tauscope_archive::ros::{
    DiagnosticArray, Float64, InertiaStamped, JointState, Level, Message, WrenchStamped,
};
use tauscope_bus::{Command, Detection, SampleRef, Sink, Verb, flags};
use tauscope_record::{Config, RecordError, Recorder};

fn recorder(path: &Path) -> Recorder {
    let config = Config {
        mcap: Some(path.to_owned()),
        ..Config::default()
    };
    let cells = [cell("demo", Some(arm(false)))];
    let provenance = BTreeMap::from([("tauscope".to_owned(), "test".to_owned())]);
    Recorder::new(&config, &cells, &streams("demo", ""), &provenance).unwrap()
}

fn record(path: &Path, instants: &[Instant]) {
    let mut recorder = recorder(path);
    for instant in instants {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
}

/// Publish time and message of each message on a topic.
fn read<M: Message>(path: &Path, topic: &str) -> Vec<(i64, M)> {
    let recording = Recording::open(path).unwrap();
    recording.topic_of::<M>(topic).unwrap();
    let mut messages = recording.messages(&[topic]).unwrap();
    let mut all = Vec::new();
    while let Some(message) = messages.next_message() {
        let message = message.unwrap();
        all.push((message.publish_time_ns, message.decode().unwrap()));
    }
    all
}

#[test]
fn every_sample_is_there_under_its_topic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/demo.mcap");
    let instants = motion(5.0);
    record(&path, &instants);

    let states = read::<JointState>(&path, "/joint_states");
    assert_eq!(states.len(), instants.len());
    for (instant, (publish_time_ns, state)) in instants.iter().zip(&states) {
        assert_eq!(*publish_time_ns, instant.state.header.stamp_ns);
        assert_eq!(state.header.stamp.ns(), instant.state.header.stamp_ns);
        assert_eq!(state.name[6], "joint7");
        assert_eq!(state.position, instant.state.position[..7]);
        assert_eq!(state.velocity, instant.state.velocity[..7]);
        assert_eq!(state.effort, instant.state.effort[..7]);
    }
    let expected = read::<JointState>(&path, "/twin/joint_states");
    assert_eq!(expected.len(), instants.len());
    assert_eq!(expected[9].1.effort, instants[9].twin.expected_effort[..7]);
    assert!(expected[9].1.position.is_empty() && expected[9].1.velocity.is_empty());

    // The filters settle after 0.8 s.
    let residual = read::<JointState>(&path, "/residual");
    let ready: Vec<_> = instants
        .iter()
        .filter(|i| i.twin.header.has(flags::READY))
        .collect();
    assert_eq!(ready.len(), 1050);
    assert_eq!(residual.len(), ready.len());
    assert_eq!(residual[7].1.effort, ready[7].twin.residual[..7]);

    let scores = read::<Float64>(&path, "/detections/twin_regression/score");
    assert_eq!(scores.len(), ready.len());
    for (instant, (publish_time_ns, score)) in ready.iter().zip(&scores) {
        assert_eq!(*publish_time_ns, instant.detection.header.stamp_ns);
        assert_eq!(score.data, instant.detection.score);
    }
    let thresholds = read::<Float64>(&path, "/detections/twin_regression/threshold");
    assert_eq!(thresholds, [(START_NS, Float64 { data: THRESHOLD })]);

    let recording = Recording::open(&path).unwrap();
    assert_eq!(recording.provenance().unwrap()["tauscope"], "test");
    assert!(!path.with_extension("mcap.part").exists());
}

#[test]
fn a_detection_is_told_once_when_it_begins_and_once_when_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let instants = motion(5.0);
    record(&path, &instants);

    let statuses = read::<DiagnosticArray>(&path, "/detections");
    let statuses: Vec<_> = statuses.iter().map(|(_, array)| &array.status[0]).collect();
    let told: Vec<_> = statuses
        .iter()
        .map(|s| (s.level, s.message.as_str()))
        .collect();
    let expected = [
        (Level::Stale as u8, "not ready"),
        (Level::Ok as u8, "free"),
        (Level::Warn as u8, "contact at link5 (first guess)"),
        (
            Level::Ok as u8,
            "contact ended after 1.04 s, at its strongest 26 N at link5",
        ),
    ];
    assert_eq!(told, expected);
    assert_eq!(statuses[2].hardware_id, "demo");
    let values_of = |status: usize| -> BTreeMap<_, _> {
        let values = statuses[status].values.iter();
        values.map(|v| (v.key.as_str(), v.value.as_str())).collect()
    };
    let values = values_of(2);
    let onset = instants
        .iter()
        .find(|i| i.detection.event == Detection::ONSET)
        .unwrap();
    let detection = &onset.detection;
    assert_eq!(values["event"], "onset");
    assert_eq!(values["detector"], "twin_regression");
    assert_eq!(values["score"].parse::<f64>().unwrap(), detection.score);
    assert_eq!(values["joints"], "joint1 joint2 joint3 joint4");
    assert_eq!(values["link"], "link5");
    assert_eq!(values["estimate"], "provisional");
    let guess_n = values["force_n"].parse::<f64>().unwrap();
    let (seconds, nanoseconds) = values["t_contact_s"].split_once('.').unwrap();
    let contact_ns = format!("{seconds}{nanoseconds}").parse::<i64>().unwrap();
    assert_eq!(contact_ns, detection.contact_ns);

    // The status at the end describes the whole contact, one number per key.
    let values = values_of(3);
    assert_eq!((values["event"], values["state"]), ("offset", "free"));
    assert_eq!((values["estimate"], values["kind"]), ("final", "contact"));
    assert_eq!(values["link"], "link5");
    let number = |key: &str| values[key].parse::<f64>().unwrap();
    let strongest = |i: &&Instant| (i.detection.score * 1e6) as i64;
    let strongest = instants.iter().max_by_key(strongest).unwrap().detection;
    let force_n = strongest.force_n;
    let peak_n = force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
    assert_eq!(number("peak_force_n"), peak_n);
    assert!(guess_n < 0.5 * peak_n, "{guess_n}");
    assert_eq!(number("direction_y"), force_n[1] / peak_n);
    assert_eq!(number("point_z_m"), strongest.point_m[2]);
    assert!((number("duration_s") - 1.04).abs() < 0.01);

    // The wrench is about the world's origin.
    let wrenches = read::<WrenchStamped>(&path, "/external_wrench");
    let touched = instants.iter().filter(|i| i.detection.alarm()).count();
    assert_eq!(wrenches.len(), touched);
    let wrench = &wrenches[0].1;
    let ([x, y, _], [fx, fy, _]) = (detection.point_m, detection.force_n);
    assert_eq!(wrench.header.frame_id, "link0");
    assert_eq!(<[f64; 3]>::from(wrench.wrench.force), detection.force_n);
    assert!((wrench.wrench.torque.z - (x * fy - y * fx)).abs() < 1e-12);

    let reports = read::<DiagnosticArray>(&path, "/diagnostics");
    assert_eq!(reports.len(), 5);
    assert_eq!(reports[3].1.status[0].name, "twin");
    assert_eq!(reports[3].1.status[0].values[0].value, "750");
}

#[test]
fn what_happens_during_a_mute_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let mut instants = motion(5.0);
    // The mute begins two samples before the contact and ends before the contact does.
    let is_onset = |i: &Instant| i.detection.event == Detection::ONSET;
    let onset = instants.iter().position(is_onset).unwrap();
    instants[onset - 2].state.command = Command {
        verb: Verb::Mute as u32,
        value: 0.5,
        ..Command::default()
    };
    record(&path, &instants);

    let statuses = read::<DiagnosticArray>(&path, "/detections");
    let muted = statuses.iter().map(|(_, array)| {
        let mut values = array.status[0].values.iter();
        values.any(|pair| pair.key == "muted" && pair.value == "true")
    });
    assert_eq!(muted.collect::<Vec<_>>(), [false, false, true, false]);
}

#[test]
fn what_was_not_measured_stays_empty() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let mut instants = motion(0.1);
    for instant in &mut instants {
        instant.state.header.flags = 0;
    }
    record(&path, &instants);
    let states = read::<JointState>(&path, "/joint_states");
    assert!(
        states
            .iter()
            .all(|(_, s)| s.velocity.is_empty() && s.effort.is_empty())
    );
    assert!(states.iter().all(|(_, s)| s.position.len() == 7));
}

#[test]
fn command_and_tool_are_kept_when_they_change_and_a_command_now_and_then() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    // 0.4 s; the command changes after 0.04 s, the tool is attached after 0.1 s and detached after 0.2 s.
    let mut instants = motion(0.4);
    for (k, instant) in instants.iter_mut().enumerate() {
        let state = &mut instant.state;
        state.header.flags |= flags::COMMAND | flags::COMMAND_VELOCITY;
        state.command_position[0] = if k < 10 { 1.0 } else { 2.0 };
        if (25..50).contains(&k) {
            state.header.flags |= flags::TOOL;
            state.tool_mass_kg = 0.4;
            state.tool_inertia_kgm2[5] = 0.01;
        }
    }
    record(&path, &instants);
    let commands = read::<JointState>(&path, "/joint_commands");
    let told: Vec<_> = commands
        .iter()
        .map(|(ns, c)| ((ns - START_NS) / STEP_NS, c.position[0]))
        .collect();
    assert_eq!(told, [(0, 1.0), (10, 2.0), (35, 2.0), (60, 2.0), (85, 2.0)]);
    assert_eq!(commands[0].1.velocity, [0.0; 7]);
    let tools = read::<InertiaStamped>(&path, "/tool");
    let told: Vec<_> = tools
        .iter()
        .map(|(ns, t)| ((ns - START_NS) / STEP_NS, t.inertia.m, t.inertia.izz))
        .collect();
    assert_eq!(told, [(25, 0.4, 0.01), (50, 0.0, 0.0)]);
}

#[test]
fn the_same_samples_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    // Both files have one name, because the bag's metadata contains it.
    let paths = ["a", "b"].map(|below| folder.path().join(below).join("demo.mcap"));
    let instants = motion(4.0);
    let [a, b] = paths.map(|path| {
        record(&path, &instants);
        std::fs::read(path).unwrap()
    });
    assert!(a.len() > 100_000);
    assert!(a == b, "the archives differ");
}

#[test]
fn two_cells_lie_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("both.mcap");
    let config = Config {
        mcap: Some(path.clone()),
        ..Config::default()
    };
    let cells = [cell("left", None), cell("right", None)];
    let both: Vec<_> = [streams("left", "_l"), streams("right", "_r")].concat();
    let mut recorder = Recorder::new(&config, &cells, &both, &BTreeMap::new()).unwrap();
    let instants = motion(1.0);
    for instant in &instants {
        instant.feed(&mut recorder, "_l");
        instant.feed(&mut recorder, "_r");
    }
    recorder.finish().unwrap();
    for cell in ["left", "right"] {
        let states = read::<JointState>(&path, &format!("/{cell}/joint_states"));
        assert_eq!(states.len(), instants.len());
        read::<Float64>(&path, &format!("/{cell}/detections/twin_regression/score"));
    }
}

#[test]
fn a_recorder_that_died_leaves_a_part_that_reads_to_the_last_silence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.mcap");
    let instants = motion(1.0);
    let mut recorder = recorder(&path);
    for instant in &instants {
        instant.feed(&mut recorder, "");
    }
    recorder.idle().unwrap();
    let part = folder.path().join("copy.mcap");
    std::fs::copy(folder.path().join("demo.mcap.part"), &part).unwrap();
    assert!(!path.exists());
    let states = read::<JointState>(&part, "/joint_states");
    assert_eq!(states.len(), instants.len());
}

#[test]
fn what_was_not_announced_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut recorder = recorder(&folder.path().join("demo.mcap"));
    let instant = motion(0.1)[0];
    let error = recorder
        .accept("inget", SampleRef::JointState(&instant.state))
        .unwrap_err();
    assert_eq!(
        error.to_string(),
        "a sample came from stage `inget`, but the recorder listens only to: `detect`, `ingest`, `twin`"
    );
    let error = recorder
        .accept("twin", SampleRef::JointState(&instant.state))
        .unwrap_err();
    assert!(
        error
            .to_string()
            .contains("stage `twin` sent a tauscope/JointState/2"),
        "{error}"
    );
}

#[test]
fn a_recorder_without_an_output_is_an_error() {
    let none = Recorder::new(&Config::default(), &[], &[], &BTreeMap::new());
    assert!(matches!(none, Err(RecordError::NothingToWrite)));
}
