//! Properties that every source of the table must have.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::fmt::Write as _;
use std::path::Path;

use crate::common::{Collect, cell, drain, state, write_bag};
use tauscope_bus::{JointState, Progress, Source};
use tauscope_dynamics::Model;
use tauscope_ingest::simulated::Scenario;
use tauscope_ingest::{Config, SOURCES, Setup, SimulatedRobot, open};

const STEP_NS: i64 = 10_000_000;
const SAMPLES: i64 = 300;
const JOINTS: &str = "joint1 joint2 joint3 joint4 joint5 joint6 joint7";
/// The joints in another order.
const TURNED: &str = "joint7 joint3 joint1 joint2 joint6 joint5 joint4";

fn data(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data")
        .join(name)
}

/// Returns positions that identify the joints: joint j is at 100 j rad and turns slowly.
fn positions(k: i64) -> Vec<f64> {
    (1..=7)
        .map(|j| 100.0 * f64::from(j) + 0.001 * k as f64)
        .collect()
}

/// Returns the settings of a source with a small example to read; `None` for a live one.
fn example(source: &str, folder: &Path) -> Option<String> {
    match source {
        "file" => {
            let path = folder.join("a.mcap");
            let message = |k: i64| {
                let effort = vec![1.0; 7];
                (
                    "/joint_states",
                    k * STEP_NS,
                    state(k * STEP_NS, JOINTS, &positions(k), &effort),
                )
            };
            write_bag(&path, &(1..=SAMPLES).map(message).collect::<Vec<_>>());
            Some(format!(
                "{{file: {{path: {}}}, rate: fast}}",
                path.display()
            ))
        }
        "csv" => {
            let path = folder.join("a.csv");
            let mut text = String::new();
            for k in 1..=SAMPLES {
                let numbers = positions(k).into_iter().chain([1.0; 7]);
                let numbers: Vec<String> = numbers.map(|x| x.to_string()).collect();
                writeln!(text, "{},{}", k as f64 * 0.01, numbers.join(",")).unwrap();
            }
            std::fs::write(&path, text).unwrap();
            let joints = JOINTS.replace(' ', ", ");
            let columns = format!(
                "{{time: {{number: 1}}, position: {{first: 2}}, effort: {{first: 9}}, joints: [{joints}]}}"
            );
            Some(format!(
                "{{csv: {{path: {}, columns: {columns}}}, rate: fast}}",
                path.display()
            ))
        }
        "simulate" => {
            let path = data("demo.scenario.yaml");
            Some(format!(
                "{{simulate: {{scenario: {}, recording: demo}}, rate: fast}}",
                path.display()
            ))
        }
        "zenoh" | "ur_rtde" => None,
        other => panic!("the source `{other}` has no example here"),
    }
}

fn robot() -> SimulatedRobot {
    let text = std::fs::read_to_string(data("demo.scenario.yaml")).unwrap();
    let scenario: Scenario = serde_saphyr::from_str(&text).unwrap();
    let urdf = std::fs::read_to_string(data("demo_arm.urdf")).unwrap();
    SimulatedRobot {
        scenario,
        model: Model::from_urdf(&urdf).unwrap(),
    }
}

fn opened(config: &Config, setup: &Setup) -> Box<dyn Source<JointState>> {
    open(config, setup, Some(&robot())).unwrap()
}

/// Runs a check on each source that ends.
fn each(mut check: impl FnMut(&str, &Config)) {
    let folder = tempfile::tempdir().unwrap();
    for entry in SOURCES {
        if let Some(text) = example(entry.name, folder.path()) {
            let config: Config = serde_saphyr::from_str(&text).unwrap();
            assert_eq!(config.source().map(|(name, _)| name), Ok(entry.name));
            check(entry.name, &config);
        }
    }
}

#[test]
fn the_same_is_read_twice_in_the_order_of_its_stamps_and_then_it_ends() {
    each(|name, config| {
        let mut source = opened(config, &cell(JOINTS));
        let first = drain(&mut source);
        assert!(first.len() >= SAMPLES as usize, "{name}: {}", first.len());
        let rising = |pair: &[JointState]| pair[0].header.stamp_ns < pair[1].header.stamp_ns;
        assert!(first.windows(2).all(rising), "{name}");
        assert_eq!(source.dropped(), 0, "{name}");
        assert_eq!(source.fraction_done(), Some(1.0), "{name}");
        // It stays ended.
        let mut out = Collect(Vec::new());
        assert_eq!(source.step(&mut out).unwrap(), Progress::End, "{name}");
        assert!(out.0.is_empty(), "{name}");
        let again = drain(&mut opened(config, &cell(JOINTS)));
        assert!(format!("{first:?}") == format!("{again:?}"), "{name}");
    });
}

#[test]
fn samples_come_in_the_cells_order_of_joints() {
    each(|name, config| {
        if name == "simulate" {
            // A simulated robot's joints are in the order of its URDF, as the cell's are.
            return;
        }
        let plain = drain(&mut opened(config, &cell(JOINTS)));
        let turned = drain(&mut opened(config, &cell(TURNED)));
        assert_eq!(plain.len(), turned.len(), "{name}");
        for (plain, turned) in plain.iter().zip(&turned) {
            for (j, joint) in TURNED.split(' ').enumerate() {
                let own = JOINTS.split(' ').position(|other| other == joint).unwrap();
                let (one, other) = (plain.position[own], turned.position[j]);
                assert_eq!(one.to_bits(), other.to_bits(), "{name}");
            }
        }
    });
}

#[test]
fn a_file_that_is_not_there_is_the_fault_of_who_named_it() {
    each(|name, config| {
        let mut config = config.clone();
        let path = config.path_mut().unwrap();
        let there = path.clone();
        *path = path.with_extension("gone");
        match open(&config, &cell(JOINTS), None) {
            Ok(_) => panic!("{name} has opened a file that is not there"),
            Err(error) => assert!(error.is_input(), "{name}: {error}"),
        }
        let (_, source) = config.source().unwrap();
        assert!(source.file().is_some() && there.exists(), "{name}");
    });
}

#[test]
fn a_source_without_a_file_is_live_and_says_what_would_let_it_be_reached() {
    let folder = tempfile::tempdir().unwrap();
    for entry in SOURCES {
        if example(entry.name, folder.path()).is_some() {
            continue;
        }
        // Without an address.
        let text = match entry.name {
            "ur_rtde" => "{ur_rtde: {host: \"\"}}".to_owned(),
            name => format!("{{{name}: {{}}}}"),
        };
        let config: Config = serde_saphyr::from_str(&text).unwrap();
        let (_, source) = config.source().unwrap();
        assert!(source.file().is_none(), "{}", entry.name);
        assert!(source.fault().is_some(), "{}", entry.name);
    }
}
