//! The contacts of a recording are found when a Universal Robots controller sends it, as in the file.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;
use std::time::Duration;

use crate::common::live;
use crate::common::live::{Live, signal, stage};
use crate::common::ur_controller::{Behaviour, Controller, Instant};
use crate::common::{bundled, write};
use tauscope_archive::Recording;

/// Contacts of the bundled recording.
const CONTACTS: usize = 6;

/// The bundled arm without its last joint, because such a controller has six, with this source.
fn pipeline(folder: &Path, source: &str) {
    let urdf = std::fs::read_to_string(bundled().join("demo_arm.urdf")).unwrap();
    let moving = r#"<joint name="joint7" type="revolute">"#;
    assert!(urdf.contains(moving));
    let fixed = urdf.replace(moving, r#"<joint name="joint7" type="fixed">"#);
    write(&folder.join("six.urdf"), &fixed);
    let text = format!(
        "version: 1
cells: {{demo: {{robot: six.urdf}}}}
stages:
- {{name: ingest, ingest: {{{source}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: detect, input: twin, detect: {{momentum_observer: {{}}, threshold: {{score: 6}}}}}}
- {{name: record, inputs: [ingest, twin, detect], record: {{mcap: \"out-{{n}}.mcap\"}}}}
"
    );
    write(&folder.join("pipeline.yaml"), &text);
}

/// Measured values of a controller, from the bundled recording.
fn instants() -> Vec<Instant> {
    let recording = Recording::open(bundled().join("demo.mcap")).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut all = Vec::new();
    let mut start_ns = None;
    while let Some(state) = states.next_state() {
        let state = state.unwrap().message;
        let ns = state.header.stamp.ns();
        let since_ns = ns - *start_ns.get_or_insert(ns);
        let six = |values: &[f64]| <[f64; 6]>::try_from(&values[..6]).unwrap();
        all.push(Instant {
            timestamp_s: 500.0 + since_ns as f64 * 1e-9,
            position: six(&state.position),
            velocity: six(&state.velocity),
            effort: six(&state.effort),
            ..Instant::default()
        });
    }
    all
}

/// Lines that report contacts.
fn told(said: &[String]) -> Vec<String> {
    let told = said.iter().filter(|line| line.starts_with("[detect]"));
    told.cloned().collect()
}

#[test]
fn contacts_are_found_over_rtde_as_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = bundled().join("demo.mcap");
    let file = format!("file: {{path: {}}}, rate: fast", path.display());
    pipeline(folder.path(), &file);
    let mut run = Live::start(folder.path(), &[]);
    let said: Vec<String> = run.rest().lines().map(str::to_owned).collect();
    let in_file = told(&said);
    assert_eq!(run.end().0, 0);
    assert!(in_file.len() >= 2 * CONTACTS, "{said:#?}");

    let instants = instants();
    let count = instants.len();
    let behaviour = Behaviour {
        pause: Duration::from_millis(2),
        ..Behaviour::default()
    };
    let controller = Controller::start(behaviour, instants);
    let rtde = format!(
        "ur_rtde: {{host: 127.0.0.1, port: {}, rate_hz: 100, effort: actual_current_as_torque}}",
        controller.port
    );
    pipeline(folder.path(), &rtde);
    let mut run = Live::start(folder.path(), &[]);
    run.wait_for(in_file.last().unwrap());
    let live = told(&run.heard);
    live::wait_until("all instants", || controller.sent() == count);
    std::thread::sleep(Duration::from_millis(300));
    signal(run.id(), "INT");
    let (code, summary) = run.end();
    assert_eq!(live, in_file);
    assert_eq!(code, 0, "{summary}");
    assert_eq!(stage(&summary, "ingest")["emitted"], count, "{summary}");
}
