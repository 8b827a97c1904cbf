//! The detect stage: scores, thresholds, events, and the touched link.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::collections::BTreeMap;

use crate::common::Out;
use tauscope_bus::{Detection, EventKind, Header, Stage, TwinState, flags};
use tauscope_detect::tajiri::{naive_difference, twin_regression};
use tauscope_detect::{Config, ConfigError, Detect, JointSetup, ScoreStatistics, Setup, Threshold};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian};

/// Three joints in a row, axes z, y, y, half a metre apart.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="shoulder"><inertial><origin xyz="0 0 0.25"/><mass value="3"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="upper"><inertial><origin xyz="0 0 0.25"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.25"/><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="shoulder"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><origin xyz="0 0 0.5"/><parent link="shoulder"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="continuous"><origin xyz="0 0 0.5"/><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/></joint>
</robot>"#;

fn joint() -> JointSetup {
    JointSetup {
        gain: 2.0,
        offset: 1.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    }
}

fn setup() -> Setup {
    let score = ScoreStatistics {
        mean: 1.0,
        standard_deviation: 0.5,
    };
    Setup {
        joints: vec![joint(); 3],
        model: Some(Model::from_urdf(ARM).unwrap()),
        scores: BTreeMap::from([("twin_regression".to_owned(), score)]),
        ..Setup::default()
    }
}

fn twin_regression() -> Config {
    Config::of(twin_regression::Settings::default())
}

/// Returns a twin's sample at `i` hundredths of a second with this residual.
fn sample(i: i64, residual: [f64; 3]) -> TwinState {
    let mut sample = TwinState {
        header: Header {
            stamp_ns: 10_000_000 * (i + 1),
            flags: flags::READY,
            joint_count: 3,
            ..Header::default()
        },
        ..TwinState::default()
    };
    sample.residual[..3].copy_from_slice(&residual);
    sample
}

fn run(detect: &mut Detect, samples: impl IntoIterator<Item = TwinState>) -> Vec<Detection> {
    let mut out = Out::default();
    for sample in samples {
        detect.accept(&sample, &mut out).unwrap();
    }
    out.0
}

#[test]
fn the_score_is_the_squared_residual_and_the_threshold_mean_plus_four_deviations() {
    let mut detect = twin_regression().stage(setup()).unwrap();
    let verdict = run(&mut detect, [sample(0, [1.0, -2.0, 0.5])])[0];
    assert!((verdict.score - 5.25).abs() < 1e-12);
    assert!((verdict.threshold - 3.0).abs() < 1e-12);
    assert_eq!(verdict.event(), EventKind::Onset);
    assert_eq!(verdict.detector.as_str(), "twin_regression");
}

#[test]
fn a_score_at_the_threshold_is_a_contact() {
    // Equation 7: score >= threshold.
    let config = Config {
        threshold: Threshold {
            score: Some(4.0),
            sigmas: None,
        },
        ..twin_regression()
    };
    let mut detect = config.stage(setup()).unwrap();
    assert!(run(&mut detect, [sample(0, [2.0, 0.0, 0.0])])[0].alarm());
}

#[test]
fn an_alarm_has_one_beginning_and_one_end() {
    let mut detect = twin_regression().stage(setup()).unwrap();
    let pushed = 20..40;
    let residual = |i: i64| {
        if pushed.contains(&i) {
            [0.0, 3.0, 0.0]
        } else {
            [0.0; 3]
        }
    };
    let verdicts = run(&mut detect, (0..80).map(|i| sample(i, residual(i))));
    let at = |kind| {
        let found = verdicts
            .iter()
            .enumerate()
            .filter(|(_, v)| v.event() == kind);
        found.map(|(i, _)| i).collect::<Vec<_>>()
    };
    assert_eq!(at(EventKind::Onset), [20]);
    // The last sample of the push, and the 0.1 s that a dip may last.
    assert_eq!(at(EventKind::Offset), [49]);
    assert_eq!(verdicts[20].contact_ns, verdicts[19].header.stamp_ns);
    assert_eq!(verdicts[30].state.as_str(), "contact");
    assert_eq!(verdicts[60].state.as_str(), "free");
}

#[test]
fn what_the_twin_does_not_vouch_for_raises_no_alarm() {
    let mut detect = twin_regression().stage(setup()).unwrap();
    let mut unsettled = sample(0, [9.0; 3]);
    unsettled.header.flags = 0;
    let verdict = run(&mut detect, [unsettled])[0];
    assert!(!verdict.alarm() && !verdict.header.has(flags::READY));
    assert_eq!(verdict.state.as_str(), "not_ready");
}

#[test]
fn naive_difference_undoes_gain_and_offset() {
    let config = Config {
        threshold: Threshold {
            score: Some(1.0),
            sigmas: None,
        },
        ..Config::of(naive_difference::Settings::default())
    };
    let mut detect = config.stage(setup()).unwrap();
    let mut at = sample(0, [0.0; 3]);
    for j in 0..3 {
        // The model's effort is 5; the twin corrects it to 2 * 5 + 1; the measured effort is 11.
        at.filtered_expected_effort[j] = 11.0;
        at.filtered_effort[j] = 11.0;
    }
    assert!((run(&mut detect, [at])[0].score - 3.0 * 36.0).abs() < 1e-9);
}

#[test]
fn the_touched_link_and_the_force_are_found() {
    let model = Model::from_urdf(ARM).unwrap();
    let (position, force) = ([0.3, 0.6, -0.9], [60.0, -35.0, 45.0]);
    for name in ["upper", "lower"] {
        let link = model.link_index(name).unwrap();
        let mut data = Data::new(&model);
        forward_kinematics(&model, &mut data, &position);
        let pose = tauscope_dynamics::link_pose(&model, &data, link);
        let arm = pose.rotation * nalgebra::Vector3::from(model.links()[link].com_m());
        let jacobian = link_jacobian(&model, &mut data, link);
        let force = nalgebra::Vector3::from(force);
        let mut at = sample(0, [0.0; 3]);
        at.position[..3].copy_from_slice(&position);
        for j in 0..3 {
            let column = jacobian.column(j);
            let angular = column.fixed_rows::<3>(3).into_owned();
            let row = column.fixed_rows::<3>(0) + angular.cross(&arm);
            // The external torque is minus the residual.
            at.residual[j] = -row.dot(&force);
        }
        let mut detect = twin_regression().stage(setup()).unwrap();
        let verdict = run(&mut detect, [at])[0];
        assert_eq!(verdict.link.as_str(), name);
        assert!(verdict.header.has(flags::FORCE));
        // The joints do not sense a force along the upper arm: the estimate is the smallest force that fits.
        let found = nalgebra::Vector3::from(verdict.force_n);
        assert!(found.norm() <= force.norm() * 1.01);
        assert!(
            found.dot(&force) > 0.3 * force.norm_squared(),
            "{name}: {found:?}"
        );
    }
}

#[test]
fn a_configuration_that_says_too_much_or_too_little_is_refused() {
    let none = Config::default().stage(setup()).err().unwrap();
    assert_eq!(none, ConfigError::OneDetector { found: 0 });
    let two = twin_regression().with(naive_difference::Settings::default());
    assert_eq!(
        two.stage(setup()).err().unwrap(),
        ConfigError::OneDetector { found: 2 }
    );
    let unmeasured = Setup {
        scores: BTreeMap::new(),
        ..setup()
    };
    let error = twin_regression().stage(unmeasured).err().unwrap();
    assert!(error.to_string().contains("tauscope calibrate"), "{error}");
    let both = Config {
        threshold: Threshold {
            sigmas: Some(3.0),
            score: Some(9.0),
        },
        ..twin_regression()
    };
    assert_eq!(
        both.stage(setup()).err().unwrap(),
        ConfigError::TwoThresholds
    );
}
