//! The detectors after Salt Ducaju et al.: the stage on a synthetic arm.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::sync::LazyLock;

use crate::common::Out;
use tauscope_bus::{Detection, EventKind, Header, Stage, TwinState, flags};
use tauscope_detect::salt_ducaju::contact_signals::SignalSettings;
use tauscope_detect::salt_ducaju::{contact_classifier, fisher_discriminant, frequency_classifier};
use tauscope_detect::{
    Config, ConfigError, ContactKind, JointSetup, LabelledContact, LearnError, Lesson, Lessons,
    Setup,
};
use tauscope_dynamics::{Data, Model, forward_kinematics, link_jacobian};

const MS: i64 = 1_000_000;

const COLLISION: ContactKind = ContactKind::Collision;
const COOPERATION: ContactKind = ContactKind::Cooperation;

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

const Q: [f64; 3] = [0.3, 0.6, 0.9];

fn setup() -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: Some(0.1),
        effort_per_nm: 1.0,
    };
    Setup {
        joints: vec![joint; 3],
        model: Some(Model::from_urdf(ARM).unwrap()),
        contact_point_on_tool_m: Some([0.0, 0.0, 0.5]),
        ..Setup::default()
    }
}

/// Linear Jacobian of the tool point, by joint.
static JACOBIAN: LazyLock<[[f64; 3]; 3]> = LazyLock::new(jacobian);

fn jacobian() -> [[f64; 3]; 3] {
    let model = Model::from_urdf(ARM).unwrap();
    let mut data = Data::new(&model);
    forward_kinematics(&model, &mut data, &Q);
    let link = model.tool_link();
    let arm = tauscope_dynamics::link_pose(&model, &data, link).rotation
        * nalgebra::Vector3::new(0.0, 0.0, 0.5);
    let columns = link_jacobian(&model, &mut data, link).clone();
    let linear = |j: usize| {
        let angular: nalgebra::Vector3<f64> = columns.fixed_view::<3, 1>(3, j).into();
        columns.fixed_view::<3, 1>(0, j) + angular.cross(&arm)
    };
    std::array::from_fn(|i| std::array::from_fn(|j| linear(j)[i]))
}

/// Returns a sample of the arm passing `Q` with joint velocities `qd`, with a force on the tool point.
fn sample(ms: i64, qd: [f64; 3], force_n: [f64; 3]) -> TwinState {
    let mut sample = TwinState {
        header: Header {
            stamp_ns: ms * MS,
            flags: flags::READY,
            joint_count: 3,
            ..Header::default()
        },
        ..TwinState::default()
    };
    for j in 0..3 {
        sample.position[j] = Q[j];
        sample.velocity[j] = qd[j];
        sample.expected_effort[j] = 3.0;
        let external: f64 = (0..3).map(|i| JACOBIAN[i][j] * force_n[i]).sum();
        sample.effort[j] = 3.0 - external;
    }
    sample
}

fn classifier() -> Config {
    Config::of(contact_classifier::Settings {
        signals: SignalSettings {
            window: 200,
            ..SignalSettings::default()
        },
        ..contact_classifier::Settings::default()
    })
}

fn run(config: &Config, samples: impl IntoIterator<Item = TwinState>) -> Vec<Detection> {
    let mut detect = config.stage(setup()).unwrap();
    let mut out = Out::default();
    for sample in samples {
        detect.accept(&sample, &mut out).unwrap();
    }
    out.0
}

/// Returns a force that rises within 30 ms from `at` on.
fn ramp(ms: i64, at: i64, force_n: [f64; 3]) -> [f64; 3] {
    let share = ((ms - at) as f64 / 30.0).clamp(0.0, 1.0);
    force_n.map(|force| force * share)
}

/// Returns joint velocities, and a force of 20 N against (-1) or along (+1) the resulting motion of the tool.
fn moving(sense: f64) -> ([f64; 3], [f64; 3]) {
    let qd = [0.2, 0.3, -0.5];
    let velocity = JACOBIAN.map(|row| row.iter().zip(&qd).map(|(j, qd)| j * qd).sum::<f64>());
    let speed = velocity.iter().map(|v| v * v).sum::<f64>().sqrt();
    (qd, velocity.map(|v| sense * 20.0 * v / speed))
}

#[test]
fn a_collision_is_told_from_a_cooperation() {
    for (sense, state) in [(-1.0, "collision"), (1.0, "cooperation")] {
        let (qd, force) = moving(sense);
        let samples = (0..600).map(|ms| sample(ms, qd, ramp(ms, 400, force)));
        let verdicts = run(&classifier(), samples);
        let onset = verdicts.iter().position(|v| v.event() == EventKind::Onset);
        let onset = onset.unwrap_or_else(|| panic!("no {state}"));
        let verdict = &verdicts[onset];
        assert_eq!(verdict.state.as_str(), state);
        assert!(
            (400..440).contains(&onset),
            "{state} after {} ms",
            onset - 400
        );
        assert!((verdict.contact_ns - 400 * MS).abs() <= 15 * MS);
        assert_eq!(verdict.link.as_str(), "lower");
        assert!(verdicts[399].score < 0.01 && verdict.score > verdict.threshold);
        assert!(!verdicts[599 - 1].header.has(flags::RESET));
    }
}

#[test]
fn a_verdict_tells_of_the_norms_and_while_a_contact_lasts_of_both_directions() {
    let (qd, force) = moving(-1.0);
    let samples = (0..600).map(|ms| sample(ms, qd, ramp(ms, 400, force)));
    let verdicts = run(&classifier(), samples);
    assert!(!verdicts[100].header.has(flags::CONTENT), "not ready");
    let free = &verdicts[399];
    assert!(free.header.has(flags::CONTENT) && !free.header.has(flags::DIRECTIONS));
    let onset = verdicts.iter().find(|v| v.event() == EventKind::Onset);
    let onset = onset.unwrap();
    let largest = onset.content_n.into_iter().fold(0.0, f64::max);
    assert!((largest - onset.score).abs() < f64::EPSILON);
    assert!(onset.header.has(flags::DIRECTIONS));
    let (rise, motion) = (onset.rise_direction, onset.motion_direction);
    for unit in [rise, motion] {
        let length = unit.iter().map(|x| x * x).sum::<f64>();
        assert!((length - 1.0).abs() < 1e-9);
    }
    // Opposite directions: an obstacle.
    let cosine: f64 = rise.iter().zip(motion).map(|(a, b)| a * b).sum();
    assert!(cosine < -0.8, "{cosine}");
}

#[test]
fn a_push_on_a_standing_arm_is_a_cooperation() {
    let samples = (0..600).map(|ms| sample(ms, [0.0; 3], ramp(ms, 400, [0.0, 15.0, 40.0])));
    let verdicts = run(&classifier(), samples);
    let onset = verdicts.iter().find(|v| v.event() == EventKind::Onset);
    assert_eq!(onset.unwrap().state.as_str(), "cooperation");
}

#[test]
fn it_is_ready_once_the_window_is_full_and_again_after_a_reset() {
    let samples = (0..900).map(|ms| {
        let mut sample = sample(ms, [0.0; 3], [0.0; 3]);
        if ms == 500 {
            sample.header.flags |= flags::RESET;
        }
        sample
    });
    let verdicts = run(&classifier(), samples);
    let ready: Vec<bool> = verdicts
        .iter()
        .map(|v| v.header.has(flags::READY))
        .collect();
    // The observer settles in 47 ms, the window fills in 200.
    let first = ready.iter().position(|&ready| ready).unwrap();
    assert_eq!(first, 246);
    assert!(ready[first..500].iter().all(|&ready| ready));
    assert!(!ready[500..746].iter().any(|&ready| ready) && ready[746]);
}

#[test]
fn an_alarm_does_not_outlast_a_gap() {
    let (qd, force) = moving(-1.0);
    let samples = (0..600).map(|ms| {
        let mut sample = sample(ms, qd, ramp(ms, 400, force));
        if ms == 500 {
            sample.header.flags |= flags::RESET;
            sample.header.flags &= !flags::READY;
        }
        sample
    });
    let verdicts = run(&classifier(), samples);
    assert!(verdicts[499].alarm());
    assert_eq!(verdicts[500].event(), EventKind::Offset);
    assert!(!verdicts[501..].iter().any(Detection::alarm));
}

#[test]
fn the_frequency_classifier_goes_by_the_second_threshold() {
    let config = |collision_threshold_n| {
        Config::of(frequency_classifier::Settings {
            signals: SignalSettings {
                window: 200,
                ..SignalSettings::default()
            },
            collision_threshold_n,
            ..frequency_classifier::Settings::default()
        })
    };
    let samples = || (0..600).map(|ms| sample(ms, [0.0; 3], ramp(ms, 400, [0.0, 15.0, 40.0])));
    for (threshold, state) in [(1.0, "collision"), (1e3, "cooperation")] {
        let verdicts = run(&config(threshold), samples());
        let onset = verdicts.iter().find(|v| v.event() == EventKind::Onset);
        assert_eq!(onset.unwrap().state.as_str(), state);
    }
}

#[test]
fn a_band_that_the_stream_does_not_hold_ends_the_stage_with_the_reason() {
    let mut detect = classifier().stage(setup()).unwrap();
    let mut out = Out::default();
    let mut slow = (0..600).map(|i| sample(10 * i, [0.0; 3], [0.0; 3]));
    let error = slow.find_map(|sample| detect.accept(&sample, &mut out).err());
    let text = error.unwrap().to_string();
    assert!(
        text.contains("a band up to 100 Hz needs more than 200 samples a second"),
        "{text}"
    );
}

#[test]
fn a_discriminant_that_has_learnt_nothing_does_not_run() {
    let config = Config::of(fisher_discriminant::Settings::default());
    let error = config.stage(setup()).err();
    let detector = "fisher_discriminant";
    assert_eq!(error, Some(ConfigError::NotLearnt { detector }));
}

/// Returns a recording with a force of this sense from 400 ms on for 300 ms.
fn lesson(sense: f64, kind: ContactKind) -> Lesson {
    let (qd, force) = moving(sense);
    let shape = |ms: i64| {
        let (up, down) = (ramp(ms, 400, force), ramp(ms, 670, force));
        // Remaining noise of a real arm.
        std::array::from_fn(|i| up[i] - down[i] + 0.05 * (0.2 * ms as f64).sin())
    };
    Lesson {
        name: "lesson".to_owned(),
        samples: (0..1500).map(|ms| sample(ms, qd, shape(ms))).collect(),
        contacts: Some(vec![LabelledContact {
            on_ns: 400 * MS,
            off_ns: 700 * MS,
            kind,
            ignore: false,
        }]),
    }
}

#[test]
fn tuning_finds_all_and_nothing_false_and_parts_the_kinds() {
    let train = [lesson(-1.0, COLLISION), lesson(1.0, COOPERATION)];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let config = classifier();
    let settings = config.settings::<contact_classifier::Settings>().unwrap();
    let learnt = contact_classifier::learn(settings, &setup(), &lessons).unwrap();
    let threshold = learnt.detection.force_threshold_n;
    assert!((0.005..0.2).contains(&threshold), "{threshold}");
    // Parallel vectors have a ratio of √3, and no contact bounds γ above: the paper's γ is chosen.
    assert!((learnt.gamma - 6.2).abs() < 1e-9, "{}", learnt.gamma);
    let sweeps = contact_classifier::sweeps(&learnt, &setup(), &lessons).unwrap();
    let at = |share: f64| {
        let mut sweep = sweeps.detection.iter();
        *sweep
            .find(|at| at.force_threshold_n >= share * threshold)
            .unwrap()
    };
    assert_eq!(at(0.999).false_alarms, 0);
    assert_eq!(
        (at(0.999).collisions.missed, at(0.999).cooperations.missed),
        (0, 0)
    );
    assert!(at(0.25).false_alarms > 0);
    assert!(at(3.0).collisions.mean_delay_s > at(0.999).collisions.mean_delay_s);
    assert!((sweeps.class.last().unwrap().specificity - 1.0).abs() < 1e-12);

    let settings = fisher_discriminant::Settings {
        signals: settings.signals,
        ..fisher_discriminant::Settings::default()
    };
    let learnt = fisher_discriminant::learn(&settings, &setup(), &lessons).unwrap();
    assert!(learnt.discriminant.is_some());
}

#[test]
fn tuning_without_both_kinds_or_labels_says_so() {
    let config = classifier();
    let settings = config.settings::<contact_classifier::Settings>().unwrap();
    let learn = |train: &[Lesson]| {
        let lessons = Lessons {
            train,
            validation: &[],
        };
        contact_classifier::learn(settings, &setup(), &lessons).unwrap_err()
    };
    let error = learn(&[lesson(-1.0, COLLISION)]);
    assert!(matches!(error, LearnError::NoLabels { .. }), "{error}");
    let mut unlabelled = lesson(1.0, COOPERATION);
    unlabelled.contacts = None;
    assert!(matches!(learn(&[unlabelled]), LearnError::NoLabels { .. }));
}
