//! `momentum_observer`: the score of an arm at rest is independent of the twin's regression.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use tauscope_bus::{Header, TwinState, flags};
use tauscope_detect::tajiri::momentum_observer;
use tauscope_detect::{Config, ConfigError, JointSetup, Setup};
use tauscope_dynamics::Model;

const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.5"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
</robot>"#;

fn setup(gain: f64, offset: f64) -> Setup {
    let joint = JointSetup {
        gain,
        offset,
        noise: None,
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint],
        model: Some(Model::from_urdf(ARM).unwrap()),
        ..Setup::default()
    }
}

fn config() -> Config {
    Config::of(momentum_observer::Settings::default())
}

/// Returns a sample of an arm at rest after `i` hundredths of a second: the model's effort is 3, the measured one 5.
fn sample(i: i64, gain: f64, offset: f64) -> TwinState {
    let mut sample = TwinState {
        header: Header {
            stamp_ns: 10_000_000 * (i + 1),
            flags: flags::READY | if i == 0 { flags::RESET } else { 0 },
            joint_count: 1,
            ..Header::default()
        },
        ..TwinState::default()
    };
    sample.effort[0] = 5.0;
    sample.expected_effort[0] = gain * 3.0 + offset;
    sample
}

#[test]
fn the_score_at_rest_is_the_squared_difference_to_the_rigid_body() {
    for (gain, offset) in [(1.0, 0.0), (1.5, -0.3)] {
        let mut detector = config().detector(&setup(gain, offset)).unwrap();
        let said: Vec<_> = (0..200)
            .map(|i| detector.judge(&sample(i, gain, offset)))
            .collect();
        assert!((said[199].score - 4.0).abs() < 1e-6, "{:?}", said[199]);
        assert!(!said[0].ready && said[199].ready);
    }
}

#[test]
fn after_a_gap_it_begins_anew() {
    let mut detector = config().detector(&setup(1.0, 0.0)).unwrap();
    for i in 0..200 {
        detector.judge(&sample(i, 1.0, 0.0));
    }
    let mut after = sample(500, 1.0, 0.0);
    after.header.flags |= flags::RESET;
    let said = detector.judge(&after);
    assert!(!said.ready);
    assert!(said.score.abs() < 1e-12, "{said:?}");
}

#[test]
fn without_a_model_it_says_what_it_needs() {
    let error = config().detector(&Setup::default()).err().unwrap();
    assert!(matches!(error, ConfigError::NoModel { detector } if detector == "momentum_observer"));
}
