//! Detectors that share values give the same detections as alone.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::Out;
use tauscope_bus::{Detection, Stage, TwinState, flags};
use tauscope_detect::frame::Discriminant;
use tauscope_detect::indri::{virtual_collision_sensor, virtual_collision_sensor_basic};
use tauscope_detect::salt_ducaju::{contact_classifier, fisher_discriminant, frequency_classifier};
use tauscope_detect::tajiri::momentum_observer;
use tauscope_detect::{Config, Detect, JointSetup, Setup, Shared, Threshold};
use tauscope_dynamics::Model;

const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.1 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>"#;

/// Returns samples with swings and pushes, including a reset and a repeated stamp.
fn samples() -> Vec<TwinState> {
    let sample = |k: i64| {
        let mut sample = TwinState::default();
        let stamp = if k == 1700 { k - 1 } else { k };
        sample.header.stamp_ns = stamp * 1_000_000;
        sample.header.joint_count = 2;
        sample.header.flags = flags::READY | if k == 1500 { flags::RESET } else { 0 };
        let t = 1e-3 * stamp as f64;
        for j in 0..2 {
            let omega = 2.0 + j as f64;
            sample.position[j] = (omega * t).sin();
            sample.velocity[j] = omega * (omega * t).cos();
            sample.acceleration[j] = -omega * omega * (omega * t).sin();
            sample.effort[j] = if k % 800 > 700 { 5.0 } else { 0.0 };
        }
        sample
    };
    (0..4000).map(sample).collect()
}

#[test]
fn what_is_shared_changes_nothing() {
    let discriminant = Some(Discriminant {
        weights: [-1.0; 6],
        bound: 0.0,
    });
    let bias = || Some(virtual_collision_sensor::FirstBias::InOrder(vec![0.5; 2]));
    let configs = [
        Config {
            threshold: Threshold {
                score: Some(9.0),
                sigmas: None,
            },
            ..Config::of(momentum_observer::Settings::default())
        },
        Config::of(contact_classifier::Settings::default()),
        Config::of(fisher_discriminant::Settings {
            discriminant,
            ..Default::default()
        }),
        Config::of(frequency_classifier::Settings::default()),
        Config::of(virtual_collision_sensor_basic::Settings {
            bias: bias(),
            ..Default::default()
        }),
        Config::of(virtual_collision_sensor::Settings {
            bias: bias(),
            learn: virtual_collision_sensor::Learn::AtStart,
            learning_s: 0.5,
            ..Default::default()
        }),
    ];
    let run = |shared: Option<Shared>| {
        let joint = JointSetup {
            gain: 1.0,
            offset: 0.0,
            noise: Some(0.1),
            effort_per_nm: 1.0,
        };
        let setup = Setup {
            joints: vec![joint; 2],
            joint_names: vec!["a".to_owned(), "b".to_owned()],
            model: Some(Model::from_urdf(ARM).unwrap()),
            shared,
            ..Setup::default()
        };
        let stage = |config: &Config| config.stage(setup.clone()).unwrap();
        let mut stages: Vec<Detect> = configs.iter().map(stage).collect();
        let mut out = Out::default();
        for sample in &samples() {
            for stage in &mut stages {
                stage.accept(sample, &mut out).unwrap();
            }
        }
        out.0
    };
    let (alone, together) = (run(None), run(Some(Shared::default())));
    assert!(alone.iter().any(Detection::alarm));
    for (alone, together) in alone.iter().zip(&together) {
        assert_eq!(alone.score.to_bits(), together.score.to_bits());
        assert_eq!(alone.state.as_str(), together.state.as_str());
        assert_eq!(
            (alone.event, alone.contact_ns),
            (together.event, together.contact_ns)
        );
        assert_eq!(
            alone.force_n.map(f64::to_bits),
            together.force_n.map(f64::to_bits)
        );
    }
}
