//! Terminal, archive and picture report the same values for each contact of the bundled recording, and the force
//! agrees with the label.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use crate::common::{Out, bundled, tauscope, write};
use rerun::external::arrow::array::{Array, AsArray};
use rerun::external::re_log_encoding::DecoderApp;
use rerun::log::{Chunk, LogMsg};
use tauscope_archive::Recording;
use tauscope_archive::ros::{DiagnosticArray, JointState, WrenchStamped};

/// A finished contact in one of the outputs.
#[derive(Debug, Clone, PartialEq)]
struct Told {
    duration_s: String,
    force_n: String,
    link: String,
}

/// A detector, its twin, and its part of the pipeline file; `{data}` is the bundled folder.
const DETECTORS: [(&str, &str, &str); 2] = [
    (
        "tauscope",
        "demo.explained.yaml",
        "tauscope: {learnt: {data}/demo.learnt.yaml}",
    ),
    (
        "twin_regression",
        "demo.twin.yaml",
        "twin_regression: {}, threshold: {sigmas: 4}",
    ),
];

/// Runs the bundled recording at full speed in a folder of its own; returns the terminal output.
fn run(folder: &Path, (_, twin, detect): (&str, &str, &str)) -> String {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}, topics: {{state: /joint_states, command: /joint_commands}}}}, rate: fast}}}}
- {{name: twin, input: ingest, twin: {{model: {twin}}}}}
- {{name: detect, input: twin, detect: {{{detect}}}}}
- {{name: record, inputs: [ingest, twin, detect], record: {{mcap: out.mcap, rerun: {{file: out.rrd}}}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
        twin = data.join(twin).display(),
        detect = detect.replace("{data}", &data.display().to_string()),
    );
    write(&folder.join("pipeline.yaml"), &text);
    let mut command = tauscope();
    command.current_dir(folder).arg("run");
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    out.stderr
}

/// `... over after 0.84 s; at its strongest 24 N at link5, ...`, with other words before the duration.
fn told(sentence: &str) -> Option<Told> {
    let (_, rest) = sentence.split_once(" after ")?;
    let (duration_s, rest) = rest.split_once(" s")?;
    let (_, rest) = rest.split_once("at its strongest ")?;
    let (force_n, rest) = rest.split_once(" N at ")?;
    let link = rest.split(',').next()?.trim();
    Some(Told {
        duration_s: duration_s.to_owned(),
        force_n: force_n.to_owned(),
        link: link.to_owned(),
    })
}

type Values = BTreeMap<String, String>;

/// The values of each status of `/detections`.
fn statuses(archive: &Path) -> Vec<Values> {
    let recording = Recording::open(archive).unwrap();
    let mut messages = recording.messages(&["/detections"]).unwrap();
    let mut all = Vec::new();
    while let Some(message) = messages.next_message() {
        let array: DiagnosticArray = message.unwrap().decode().unwrap();
        for status in array.status {
            let values = status.values.into_iter();
            all.push(values.map(|value| (value.key, value.value)).collect());
        }
    }
    all
}

fn number(values: &Values, key: &str) -> f64 {
    values[key].parse().unwrap()
}

/// The texts of an entity's component, a list a row.
fn texts(picture: &Path, entity: &str, component: &'static str) -> Vec<Vec<String>> {
    let reader = BufReader::new(File::open(picture).unwrap());
    let mut all = Vec::new();
    for message in DecoderApp::decode_eager(reader).unwrap() {
        let LogMsg::ArrowMsg(store, message) = message.unwrap() else {
            continue;
        };
        let chunk = Chunk::from_arrow_msg(&message).unwrap();
        if store.is_blueprint() || chunk.entity_path().to_string() != entity || chunk.is_static() {
            continue;
        }
        let rows = chunk.components().get_array(component.into()).unwrap();
        for row in 0..rows.len() {
            let row = rows.value(row);
            let texts = row.as_string::<i32>().iter().flatten();
            all.push(texts.map(str::to_owned).collect());
        }
    }
    all
}

#[test]
fn terminal_archive_and_picture_tell_the_same_of_each_contact() {
    for detector in DETECTORS {
        tell_the_same(detector);
    }
}

fn tell_the_same(detector: (&str, &str, &str)) {
    let folder = tempfile::tempdir().unwrap();
    let terminal = run(folder.path(), detector);
    let detections = format!("/detections/{}", detector.0);
    let terminal: Vec<Told> = terminal.lines().filter_map(told).collect();
    assert_eq!(terminal.len(), 6, "{terminal:#?}");

    let statuses = statuses(&folder.path().join("out.mcap"));
    let of_estimate = |estimate: &str| -> Vec<&Values> {
        let is_it = |values: &&Values| values.get("estimate").is_some_and(|e| e == estimate);
        statuses.iter().filter(is_it).collect()
    };
    let (first, last) = (of_estimate("provisional"), of_estimate("final"));
    assert_eq!((first.len(), last.len()), (6, 6), "{statuses:#?}");
    for values in &first {
        assert_eq!((&*values["event"], &*values["state"]), ("onset", "contact"));
        assert!(number(values, "force_n") > 0.0);
    }
    let archived = last.iter().map(|values| {
        assert_eq!((&*values["event"], &*values["state"]), ("offset", "free"));
        assert_eq!(values["kind"], "contact");
        Told {
            duration_s: format!("{:.2}", number(values, "duration_s")),
            force_n: format!("{:.0}", number(values, "peak_force_n")),
            link: match values.get("other_link") {
                Some(other) => format!("{} or {other}", values["link"]),
                None => values["link"].clone(),
            },
        }
    });
    let archived: Vec<Told> = archived.collect();
    assert_eq!(archived, terminal);

    let picture = folder.path().join("out.rrd");
    let events = texts(&picture, &format!("{detections}/events"), "TextLog:text");
    let drawn: Vec<Told> = events
        .iter()
        .flatten()
        .filter_map(|text| told(text))
        .collect();
    assert_eq!(drawn, terminal);

    // The last arrow before each time without one.
    let arrows = texts(
        &picture,
        &format!("/external_wrench/{}", detector.0),
        "Arrows3D:labels",
    );
    let ends = arrows.windows(2).filter(|pair| pair[1].is_empty());
    let ends: Vec<String> = ends.flat_map(|pair| pair[0].clone()).collect();
    let expected: Vec<String> = terminal
        .iter()
        .map(|told| format!("{} N at {}", told.force_n, told.link))
        .collect();
    assert_eq!(ends, expected);
    let states = texts(
        &picture,
        &format!("{detections}/state"),
        "StateChange:state",
    );
    let mut states: Vec<String> = states.into_iter().flatten().collect();
    states.dedup();
    assert_eq!(states.iter().filter(|state| *state == "contact").count(), 6);

    is_that_of_the_label(&last);
}

/// Stamp of the bundled recording's first sample.
fn start_of_recording_s() -> f64 {
    let recording = Recording::open(bundled().join("demo.mcap")).unwrap();
    let mut messages = recording.messages(&["/joint_states"]).unwrap();
    let first: JointState = messages.next_message().unwrap().unwrap().decode().unwrap();
    first.header.stamp.ns() as f64 * 1e-9
}

/// Asserts that force, direction, link and times agree with the labels.
fn is_that_of_the_label(contacts: &[&Values]) {
    let labels = std::fs::read_to_string(bundled().join("labels.json")).unwrap();
    let labels: serde_json::Value = serde_json::from_str(&labels).unwrap();
    let labels = labels["recordings"]["demo"]["events"].as_array().unwrap();
    assert_eq!(labels.len(), contacts.len());
    let (mut right_links, start_s) = (0, start_of_recording_s());
    for (label, contact) in labels.iter().zip(contacts) {
        let of_label = |key: &str| label[key].as_f64().unwrap();
        let share = number(contact, "peak_force_n") / of_label("peak_force");
        assert!(
            (0.5..2.0).contains(&share),
            "{share} of {label}: {contact:?}"
        );
        let axes = ["direction_x", "direction_y", "direction_z"];
        let cosine: f64 = (axes.iter().enumerate())
            .map(|(i, axis)| number(contact, axis) * label["direction"][i].as_f64().unwrap())
            .sum();
        assert!(cosine > 0.3, "{cosine} of {label}: {contact:?}");
        right_links += u32::from(label["link"] == contact["link"].as_str());
        let lasts_s = of_label("t_off") - of_label("t_on");
        assert!(
            (number(contact, "duration_s") - lasts_s).abs() < 0.3,
            "{contact:?}"
        );
        let late_s = number(contact, "t_contact_s") - start_s - of_label("t_on");
        assert!(late_s.abs() < 0.7, "{late_s}: {contact:?}");
    }
    assert!(right_links >= 3, "{right_links} links are right");
}

/// The force of each moment is a numeric topic, and the peak is one of its messages.
#[test]
fn the_peak_of_a_contact_is_a_message_of_the_numeric_topic() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), DETECTORS[0]);
    let archive = folder.path().join("out.mcap");
    let recording = Recording::open(&archive).unwrap();
    let mut messages = recording.messages(&["/external_wrench"]).unwrap();
    let mut forces_n = Vec::new();
    while let Some(message) = messages.next_message() {
        let wrench: WrenchStamped = message.unwrap().decode().unwrap();
        let force: [f64; 3] = wrench.wrench.force.into();
        forces_n.push(force.iter().map(|f| f * f).sum::<f64>().sqrt());
    }
    let peaks = statuses(&archive);
    let peaks = peaks
        .iter()
        .filter(|values| values.contains_key("peak_force_n"));
    let peaks: Vec<f64> = peaks.map(|values| number(values, "peak_force_n")).collect();
    assert_eq!(peaks.len(), 6);
    for peak in peaks {
        assert!(
            forces_n.iter().any(|force| (force - peak).abs() < 1e-9),
            "{peak}"
        );
    }
}
