//! Tests of the files for the Rerun viewer, read back with Rerun's decoder, and of a viewer that is missing.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::synthetic::{arm, cell, motion, streams};
use rerun::external::re_log_encoding::DecoderApp;
use rerun::log::{Chunk, LogMsg};
use tauscope_bus::{Sink, flags};
use tauscope_record::{CellInfo, Config, RecordError, Recorder, RerunConfig, StreamInfo};

fn recorder(
    rerun: RerunConfig,
    cells: &[CellInfo],
    streams: &[StreamInfo],
) -> Result<Recorder, RecordError> {
    let config = Config {
        rerun: Some(rerun),
        ..Config::default()
    };
    Recorder::new(&config, cells, streams, &BTreeMap::new())
}

fn to_file(path: &Path) -> RerunConfig {
    RerunConfig {
        file: Some(path.to_owned()),
        connect: None,
    }
}

/// Returns the chunks of the recording by entity, and the entity paths of the blueprint.
fn read(path: &Path) -> (BTreeMap<String, Vec<Chunk>>, BTreeSet<String>) {
    let reader = BufReader::new(File::open(path).unwrap());
    let (mut recording, mut blueprint) = (BTreeMap::<_, Vec<_>>::new(), BTreeSet::new());
    for message in DecoderApp::decode_eager(reader).unwrap() {
        let LogMsg::ArrowMsg(store, message) = message.unwrap() else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(&message).unwrap();
        let entity = chunk.entity_path().to_string();
        if store.is_blueprint() {
            blueprint.insert(entity);
        } else {
            recording.entry(entity).or_default().push(chunk);
        }
    }
    (recording, blueprint)
}

/// Returns the blueprint as text.
fn blueprint_text(path: &Path) -> String {
    let reader = BufReader::new(File::open(path).unwrap());
    let mut text = String::new();
    for message in DecoderApp::decode_eager(reader).unwrap() {
        if let LogMsg::ArrowMsg(store, message) = message.unwrap()
            && store.is_blueprint()
        {
            text += &format!("{:?}", message.batch);
        }
    }
    text
}

#[test]
fn the_plot_of_a_score_names_its_unit_and_the_value_of_its_threshold() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.rrd");
    let cells = [cell("demo", Some(arm(false)))];
    let mut recorder = recorder(to_file(&path), &cells, &streams("demo", "")).unwrap();
    for instant in motion(5.0) {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    let text = blueprint_text(&path);
    assert!(text.contains("Score of twin_regression [(N m)²]"), "{text}");
    let threshold = format!(
        "threshold {} (alarm from here on)",
        crate::synthetic::THRESHOLD
    );
    assert!(text.contains(&threshold), "{text}");
}

fn rows(chunks: &[Chunk]) -> usize {
    chunks
        .iter()
        .filter(|chunk| !chunk.is_static())
        .map(Chunk::num_rows)
        .sum()
}

#[test]
fn the_file_holds_efforts_robot_and_detections_on_the_importers_paths_and_timelines() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/demo.rrd");
    let cells = [cell("demo", Some(arm(false)))];
    let mut recorder = recorder(to_file(&path), &cells, &streams("demo", "")).unwrap();
    let instants = motion(5.0);
    for instant in &instants {
        instant.feed(&mut recorder, "");
    }
    assert!(!path.exists(), "it must not look whole before it is");
    recorder.finish().unwrap();
    assert!(!path.with_extension("rrd.part").exists());

    let (recording, blueprint) = read(&path);
    for topic in [
        "/joint_states/position",
        "/joint_states/velocity",
        "/joint_states/effort",
    ] {
        assert_eq!(rows(&recording[topic]), instants.len(), "{topic}");
    }
    assert_eq!(
        rows(&recording["/twin/joint_states/effort"]),
        instants.len()
    );
    assert_eq!(rows(&recording["/residual/effort"]), 1050);
    assert_eq!(rows(&recording["/detections/twin_regression/score"]), 1050);
    // Not ready, free, contact, free; each one repeated once per second.
    assert_eq!(rows(&recording["/detections/twin_regression/state"]), 7);
    assert_eq!(rows(&recording["/detections/twin_regression/events"]), 2);
    // Eight links, fifty times a second.
    assert_eq!(rows(&recording["/transforms"]), 8 * 50 * 5);
    for link in 0..8 {
        assert!(rows(&recording[&format!("/robot/link{link}")]) >= 5);
    }
    // Sent in columns, not per sample.
    assert!(recording["/joint_states/effort"].len() < 5);

    let effort = recording["/joint_states/effort"]
        .iter()
        .find(|c| !c.is_static())
        .unwrap();
    let timelines: BTreeSet<_> = effort
        .timelines()
        .keys()
        .map(rerun::TimelineName::as_str)
        .collect();
    let expected = ["message_log_time", "message_publish_time", "ros2_timestamp"];
    assert_eq!(timelines, BTreeSet::from(expected));
    let stamps = effort.timelines()[&"ros2_timestamp".into()].times_raw();
    assert_eq!(stamps[3], instants[3].state.header.stamp_ns);
    let values = effort
        .components()
        .get_array(rerun::Scalars::descriptor_scalars().component);
    let values = values.unwrap().value(3);
    let values = values
        .as_any()
        .downcast_ref::<rerun::external::arrow::array::Float64Array>();
    assert_eq!(values.unwrap().values()[..], instants[3].state.effort[..7]);

    assert!(
        blueprint
            .iter()
            .any(|path| path.ends_with("/EyeControls3D"))
    );
    assert!(blueprint.contains("/viewport"));
}

#[test]
fn the_forces_content_its_states_and_both_directions_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demo.rrd");
    let cells = [cell("demo", Some(arm(false)))];
    let mut recorder = recorder(to_file(&path), &cells, &streams("demo", "")).unwrap();
    let mut instants = motion(5.0);
    let ready = |instant: &crate::synthetic::Instant| instant.detection.header.has(flags::READY);
    for instant in instants.iter_mut().filter(|instant| ready(instant)) {
        let detection = &mut instant.detection;
        detection.header.flags |= flags::CONTENT;
        detection.content_n = [0.1, 0.2, 0.3];
        if detection.alarm() {
            detection.state = "collision".into();
            detection.header.flags |= flags::DIRECTIONS;
            detection.rise_direction = [1.0, 0.0, 0.0];
            detection.motion_direction = [-1.0, 0.0, 0.0];
        }
    }
    for instant in &instants {
        instant.feed(&mut recorder, "");
    }
    recorder.finish().unwrap();
    let (recording, _) = read(&path);
    let content = "/detections/twin_regression/content";
    assert_eq!(rows(&recording[&format!("{content}/norms")]), 1050);
    // Not ready, free, collision, free: every 20 ms and at each change, not at every sample.
    let bands = rows(&recording[&format!("{content}/bands")]);
    assert!((200..230).contains(&bands), "{bands}");
    let directions = &recording["/external_wrench/twin_regression/directions"];
    assert!(rows(directions) > 2);
}

#[test]
fn a_robot_of_meshes_is_drawn_as_a_skeleton_and_no_robot_as_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for (name, model) in [("meshes", Some(arm(true))), ("none", None)] {
        let path = folder.path().join(name);
        let drawn = model.is_some();
        let cells = [cell("demo", model)];
        let mut recorder = recorder(to_file(&path), &cells, &streams("demo", "")).unwrap();
        for instant in motion(1.0) {
            instant.feed(&mut recorder, "");
        }
        recorder.finish().unwrap();
        let (recording, blueprint) = read(&path);
        assert_eq!(recording.contains_key("/transforms"), drawn);
        let component = rerun::Capsules3D::descriptor_lengths().component;
        let bones = |chunk: &Chunk| chunk.components().get_array(component).is_some();
        assert_eq!(recording.values().flatten().any(bones), drawn);
        assert_eq!(
            blueprint
                .iter()
                .any(|path| path.ends_with("/EyeControls3D")),
            drawn
        );
    }
}

#[test]
fn two_cells_lie_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("both.rrd");
    let cells = [
        cell("left", Some(arm(false))),
        cell("right", Some(arm(false))),
    ];
    let both: Vec<_> = [streams("left", "_l"), streams("right", "_r")].concat();
    let mut recorder = recorder(to_file(&path), &cells, &both).unwrap();
    for instant in motion(1.0) {
        instant.feed(&mut recorder, "_l");
        instant.feed(&mut recorder, "_r");
    }
    recorder.finish().unwrap();
    let (recording, _) = read(&path);
    for cell in ["left", "right"] {
        assert_eq!(
            rows(&recording[&format!("/{cell}/joint_states/effort")]),
            250
        );
        assert_eq!(rows(&recording[&format!("/{cell}/transforms")]), 8 * 50);
    }
}

#[test]
fn a_viewer_that_is_not_there_neither_blocks_nor_fills_memory_nor_holds_up_the_end() {
    // A port without a listener.
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let connect = Some(format!("rerun+http://127.0.0.1:{port}/proxy"));
    let rerun = RerunConfig {
        file: None,
        connect,
    };
    let cells = [cell("demo", Some(arm(false)))];
    let mut recorder = recorder(rerun, &cells, &streams("demo", "")).unwrap();
    // More messages than the capacity of the queue.
    let instants = motion(12.0);
    for instant in &instants {
        instant.feed(&mut recorder, "");
    }
    assert!(recorder.live_dropped() > 0);
    let before_end = Instant::now();
    recorder.finish().unwrap();
    assert!(
        before_end.elapsed() < Duration::from_secs(4),
        "{:?}",
        before_end.elapsed()
    );
}

#[test]
fn an_address_that_is_none_is_an_error_that_shows_one() {
    let rerun = RerunConfig {
        file: None,
        connect: Some("localhost".to_owned()),
    };
    let error = recorder(rerun, &[], &[]).err().unwrap().to_string();
    assert!(
        error.starts_with("`localhost` is no address of a Rerun viewer such as"),
        "{error}"
    );
}
