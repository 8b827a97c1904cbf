//! The recordings that come with tauscope, and the simulated cell they come from.
#![allow(
    clippy::unwrap_used,
    clippy::float_cmp,
    reason = "what is copied comes out as it went in"
)]

use std::path::{Path, PathBuf};

use crate::common::{cell, drain, file};
use tauscope_bus::{JointState, flags};
use tauscope_dynamics::Model;
use tauscope_ingest::simulated::{Scenario, SimulatedCell};
use tauscope_ingest::{Config, FileConfig, RecordedSource, Topics};

const JOINTS: &str = "joint1 joint2 joint3 joint4 joint5 joint6 joint7";

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/data")
        .join(name)
}

fn live(recording: &str) -> Vec<JointState> {
    let text = std::fs::read_to_string(data("demo.scenario.yaml")).unwrap();
    let scenario: Scenario = serde_saphyr::from_str(&text).unwrap();
    let urdf = std::fs::read_to_string(data("demo_arm.urdf")).unwrap();
    let model = Model::from_urdf(&urdf).unwrap();
    let (config, setup) = (Config::default(), cell(JOINTS));
    drain(&mut SimulatedCell::new(&scenario, &model, Some(recording), &config, &setup).unwrap())
}

fn recorded(name: &str) -> Vec<JointState> {
    let file = FileConfig {
        topics: Topics {
            command: Some("/joint_commands".to_owned()),
            ..Topics::default()
        },
        ..file(&data(name))
    };
    let mut source = RecordedSource::open_file(&file, &Config::default(), &cell(JOINTS)).unwrap();
    drain(&mut source)
}

#[test]
fn the_bundled_recording_is_what_its_scenario_makes() {
    let (live, recorded) = (live("demo"), recorded("demo.mcap"));
    assert_eq!((live.len(), recorded.len()), (3001, 3001));
    for (live, recorded) in live.iter().zip(&recorded) {
        assert_eq!(live.header.stamp_ns, recorded.header.stamp_ns);
        assert_eq!(live.header.flags, recorded.header.flags);
        assert!(live.header.has(flags::COMMAND | flags::VELOCITY_MEASURED));
        for j in 0..7 {
            // Machines' tanh and sin may differ in the last digit, and so by a step of a sensor.
            let near = |a: f64, b: f64, step: f64| (a - b).abs() < 2.0 * step;
            assert!(
                near(live.position[j], recorded.position[j], 1e-4),
                "{live:?} {recorded:?}"
            );
            assert!(
                near(live.velocity[j], recorded.velocity[j], 1e-3),
                "{live:?} {recorded:?}"
            );
            assert!(
                near(live.effort[j], recorded.effort[j], 0.04),
                "{live:?} {recorded:?}"
            );
        }
    }
}

#[test]
fn a_scenario_makes_no_recording_that_it_does_not_name() {
    let text = std::fs::read_to_string(data("demo.scenario.yaml")).unwrap();
    let scenario: Scenario = serde_saphyr::from_str(&text).unwrap();
    let urdf = std::fs::read_to_string(data("demo_arm.urdf")).unwrap();
    let model = Model::from_urdf(&urdf).unwrap();
    let (config, setup) = (Config::default(), cell(JOINTS));
    let error = SimulatedCell::new(&scenario, &model, Some("x"), &config, &setup).unwrap_err();
    assert_eq!(
        error.to_string(),
        "recording `x` is not there; the scenario makes demo_train_points, demo_train_sweep, \
         demo_validation, demo"
    );
}
