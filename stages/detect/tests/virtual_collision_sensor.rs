//! The virtual collision sensor on a simulated arm of two joints that repeats a cycle: its alarms, the
//! paper's four remarks, learning on request, and the state kept between runs.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::Out;
use tauscope_bus::{Detection, EventKind, Header, Stage, TwinState, flags};
use tauscope_detect::indri::virtual_collision_sensor::{FirstBias, Learn, Learnt};
use tauscope_detect::indri::{
    virtual_collision_sensor as adaptive, virtual_collision_sensor_basic as basic,
};
use tauscope_detect::{
    Config, ConfigError, ContactKind, Detect, HereOrFile, JointSetup, LabelledContact, LearnError,
    Lesson, Lessons, Setup,
};

/// Sample rate \[Hz\].
const RATE: i64 = 500;
/// Initial bias of both joints \[A\].
const BIAS: f64 = 1.0;

/// The arm's joints.
const JOINTS: [&str; 2] = ["shoulder", "elbow"];

/// Differences between the arm and its model.
#[derive(Clone, Copy, Default)]
struct World {
    /// Unmodelled payload, as a share of the model's weight.
    payload: f64,
    /// A collision of joint 2: start \[s\], duration \[s\], effort \[A\].
    collision: Option<(f64, f64, f64)>,
}

/// Returns position, velocity and acceleration of the cycle: 1 s out, 1 s of rest, 1 s back, 1 s of rest.
fn cycle(t: f64) -> (f64, f64, f64) {
    let phase = t.rem_euclid(4.0);
    let (at, sign) = if phase < 2.0 {
        (phase, 1.0)
    } else {
        (phase - 2.0, -1.0)
    };
    let s = at.min(1.0);
    let q = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
    let v = 30.0 * s * s * (1.0 - s) * (1.0 - s);
    let a = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s);
    let q = if sign > 0.0 { q } else { 1.0 - q };
    (q, sign * v, sign * a)
}

/// Returns samples of the arm for `seconds`, from `start_s` on.
fn arm(start_s: f64, seconds: f64, world: World) -> Vec<TwinState> {
    let mut state = 7_u64;
    let mut noise = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5) * 0.2
    };
    let sample = |i: i64| {
        let t = start_s + i as f64 / RATE as f64;
        let (q, v, a) = cycle(t);
        let weight = 4.0 * q.cos();
        let expected = [0.8 * a, 0.5 * a + weight];
        let push = world.collision.map_or(0.0, |(from, length, hard)| {
            let inside = t >= from && t < from + length;
            if inside {
                hard * ((t - from) / 0.03).min(1.0)
            } else {
                0.0
            }
        });
        let friction = 0.15 * (5.0 * v).tanh();
        let mut sample = TwinState {
            header: Header {
                stamp_ns: ((start_s * 1e9) as i64) + i * 1_000_000_000 / RATE,
                flags: flags::READY | if i == 0 { flags::RESET } else { 0 },
                joint_count: 2,
                ..Header::default()
            },
            ..TwinState::default()
        };
        sample.expected_effort[..2].copy_from_slice(&expected);
        sample.effort[0] = expected[0] + friction + noise();
        sample.effort[1] = expected[1] + friction + noise() + world.payload * weight + push;
        sample
    };
    (0..(seconds * RATE as f64) as i64).map(sample).collect()
}

fn setup() -> Setup {
    let joint = JointSetup {
        gain: 1.0,
        offset: 0.0,
        noise: None,
        effort_per_nm: f64::NAN,
    };
    Setup {
        joints: vec![joint; 2],
        joint_names: JOINTS.map(str::to_owned).to_vec(),
        ..Setup::default()
    }
}

/// Returns the state that a sensor has learnt while running.
fn state(detect: &Detect) -> Learnt {
    serde_json::from_value(detect.learnt().unwrap()).unwrap()
}

/// Returns a learnt state that equals the initial bias, for these joints.
fn learnt_on<const N: usize>(joints: [&str; N]) -> Learnt {
    let joint = adaptive::LearntJoint {
        ident: BIAS,
        start: BIAS,
        adapt_s: Some(0.0),
    };
    Learnt {
        joints: joints.map(|name| (name.to_owned(), joint)).into(),
    }
}

fn basic_with(settings: basic::Settings) -> Config {
    Config::of(settings)
}

fn adaptive_with(settings: adaptive::Settings) -> Config {
    Config::of(settings)
}

fn basic() -> Config {
    basic_with(basic::Settings {
        bias: Some(FirstBias::InOrder(vec![BIAS; 2])),
        ..basic::Settings::default()
    })
}

fn settings() -> adaptive::Settings {
    adaptive::Settings {
        bias: Some(FirstBias::InOrder(vec![BIAS; 2])),
        learning_s: 12.0,
        ..adaptive::Settings::default()
    }
}

fn detect(config: &Config) -> Detect {
    config.stage(setup()).unwrap()
}

fn run(detect: &mut Detect, samples: &[TwinState]) -> Vec<Detection> {
    let mut out = Out::default();
    for sample in samples {
        detect.accept(sample, &mut out).unwrap();
    }
    out.0
}

/// Returns time \[s\] and kind of each alarm.
fn alarms(verdicts: &[Detection]) -> Vec<(f64, String)> {
    let onsets = verdicts.iter().filter(|v| v.event() == EventKind::Onset);
    onsets
        .map(|v| (v.header.stamp_ns as f64 * 1e-9, v.state.to_string()))
        .collect()
}

#[test]
fn a_collision_is_found_within_tens_of_milliseconds_and_the_clean_cycles_are_silent() {
    let hit = World {
        // During the rest in the third cycle.
        collision: Some((9.5, 0.4, 4.0)),
        ..World::default()
    };
    let samples = arm(0.0, 24.0, hit);
    for config in [basic(), adaptive_with(settings())] {
        let verdicts = run(&mut detect(&config), &samples);
        let found = alarms(&verdicts);
        assert_eq!(found[0].1, "collision");
        assert!(found[0].0 > 9.5 && found[0].0 < 9.55, "{found:?}");
        assert!(
            found.iter().all(|(t, _)| (9.5..10.5).contains(t)),
            "{found:?}"
        );
        let onset = verdicts
            .iter()
            .find(|v| v.event() == EventKind::Onset)
            .unwrap();
        assert_eq!(onset.joints, 0b10);
        assert!(onset.score >= 1.0 && (onset.threshold - 1.0).abs() < f64::EPSILON);
        let contact_s = onset.contact_ns as f64 * 1e-9;
        assert!(contact_s > 9.49 && contact_s < found[0].0, "{contact_s}");
    }
}

#[test]
fn remark_1_a_payload_declared_slightly_wrong_is_no_alarm_and_collisions_are_still_found() {
    let slightly = World {
        payload: 0.1,
        collision: Some((17.5, 0.4, 4.0)),
    };
    for config in [basic(), adaptive_with(settings())] {
        let found = alarms(&run(&mut detect(&config), &arm(0.0, 24.0, slightly)));
        assert!((17.5..17.56).contains(&found[0].0), "{found:?}");
        assert!(
            found.iter().all(|(t, _)| (17.5..18.5).contains(t)),
            "{found:?}"
        );
    }
}

#[test]
fn remark_1_a_payload_declared_totally_wrong_is_an_alarm_that_is_no_collision() {
    let totally = World {
        payload: 1.5,
        collision: None,
    };
    for config in [basic(), adaptive_with(settings())] {
        let found = alarms(&run(&mut detect(&config), &arm(0.0, 24.0, totally)));
        assert!(!found.is_empty());
        assert!(
            found.iter().all(|(_, kind)| kind == "model_error"),
            "{found:?}"
        );
    }
}

#[test]
fn remark_2_at_the_start_it_is_not_ready_and_raises_nothing() {
    // The first residues are as large as in a collision.
    let hit = World {
        collision: Some((0.05, 0.1, 8.0)),
        ..World::default()
    };
    let verdicts = run(&mut detect(&basic()), &arm(0.0, 4.0, hit));
    let ready = verdicts
        .iter()
        .position(|v| v.header.has(flags::READY))
        .unwrap();
    // The low-pass's settling time, 74 ms, and T_s.
    assert_eq!(ready, 138);
    for verdict in &verdicts[..ready] {
        assert!(!verdict.alarm() && verdict.state.as_str() == "not_ready");
    }
}

#[test]
fn remark_3_without_a_request_the_first_bias_stays_for_ever() {
    let mut detect = detect(&adaptive_with(settings()));
    run(&mut detect, &arm(0.0, 60.0, World::default()));
    for joint in state(&detect).joints.values() {
        assert!((joint.start - BIAS).abs() < f64::EPSILON && joint.adapt_s.is_none());
        // The estimation runs nevertheless.
        assert!(joint.ident > 0.0 && joint.ident < BIAS);
    }
}

#[test]
fn remark_4_at_worst_alpha_less_one_is_lost() {
    // The learnt bias equals the initial bias.
    let learnt = learnt_on(JOINTS);
    let samples = arm(0.0, 20.0, World::default());
    let worst = adaptive::Settings {
        learnt: Some(HereOrFile::Here(learnt)),
        ..settings()
    };
    let without = run(&mut detect(&basic()), &samples);
    let with = run(&mut detect(&adaptive_with(worst)), &samples);
    for (without, with) in without.iter().zip(&with) {
        // Both scores are |R| over the threshold; α does not scale the threshold's margin for noise.
        assert!(with.score <= without.score + 1e-9);
        assert!(without.score <= 1.1 * with.score + 1e-9);
    }
}

#[test]
fn a_request_reaches_a_running_sensor_and_makes_it_more_sensitive() {
    // Too weak for the initial bias.
    let weak = |at| World {
        collision: Some((at, 0.4, 0.8)),
        ..World::default()
    };
    let mut samples = arm(0.0, 40.0, weak(5.5));
    samples[10 * RATE as usize].header.flags |= flags::LEARN;
    let again = arm(0.0, 40.0, weak(33.5));
    samples.truncate(30 * RATE as usize);
    samples.extend_from_slice(&again[30 * RATE as usize..]);

    let mut sensor = detect(&adaptive_with(settings()));
    let verdicts = run(&mut sensor, &samples);
    let state_at = |t: i64| verdicts[(t * RATE) as usize].state.to_string();
    assert_eq!(state_at(9), "free");
    assert_eq!(state_at(12), "learning");
    assert_eq!(state_at(23), "free");
    let found = alarms(&verdicts);
    assert!((33.5..33.6).contains(&found[0].0), "{found:?}");
    // The basic version detects neither and ignores the request.
    let mut without = detect(&basic());
    assert!(alarms(&run(&mut without, &samples)).is_empty());
    assert_eq!(without.learnt(), None);
}

#[test]
fn learning_at_the_start_is_asked_for_once_in_a_sensors_life() {
    let at_start = adaptive::Settings {
        learn: Learn::AtStart,
        ..settings()
    };
    let mut first = detect(&adaptive_with(at_start.clone()));
    let verdicts = run(&mut first, &arm(0.0, 20.0, World::default()));
    assert_eq!(verdicts[500].state.as_str(), "learning");
    let again = adaptive::Settings {
        learnt: Some(HereOrFile::Here(state(&first))),
        ..at_start
    };
    let verdicts = run(
        &mut detect(&adaptive_with(again)),
        &arm(20.0, 4.0, World::default()),
    );
    assert_eq!(verdicts[500].state.as_str(), "free");
}

#[test]
fn a_collision_teaches_nothing_not_even_the_way_up_to_its_alarm() {
    let learnt_beside = |collision: Option<(f64, f64, f64)>| {
        let mut sensor = detect(&adaptive_with(adaptive::Settings {
            learnt: Some(HereOrFile::Here(learnt_on(JOINTS))),
            ..settings()
        }));
        let mut found = 0;
        for time in 0..8 {
            let start_s = 8.0 * f64::from(time);
            let collision = collision.map(|(from, length, hard)| (start_s + from, length, hard));
            let world = World {
                collision,
                ..World::default()
            };
            found += alarms(&run(&mut sensor, &arm(start_s, 8.0, world))).len();
        }
        (found, state(&sensor))
    };
    let (none, clean) = learnt_beside(None);
    let (found, touched) = learnt_beside(Some((5.5, 0.4, 4.0)));
    assert_eq!((none, found), (0, 8));
    for joint in JOINTS {
        let (clean, touched) = (&clean.joints[joint], &touched.joints[joint]);
        assert!(touched.ident <= clean.ident && touched.start <= clean.start);
    }
}

#[test]
fn what_was_learnt_goes_on_in_the_next_life_as_if_there_had_been_one() {
    let learning = adaptive::Settings {
        learn: Learn::AtStart,
        ..settings()
    };
    let (before, after) = (
        arm(0.0, 20.0, World::default()),
        arm(20.0, 20.0, World::default()),
    );
    let mut one_life = detect(&adaptive_with(learning.clone()));
    run(&mut one_life, &before);
    let next = adaptive::Settings {
        learnt: Some(HereOrFile::Here(state(&one_life))),
        ..learning
    };
    let whole = run(&mut one_life, &after);
    let mut next_life = detect(&adaptive_with(next));
    assert_eq!(run(&mut next_life, &after), whole);
    assert_eq!(next_life.learnt(), one_life.learnt());
}

#[test]
fn what_was_learnt_goes_to_the_joint_of_its_name_in_whatever_order_joints_come() {
    let mut learnt = learnt_on(JOINTS);
    learnt.joints.get_mut("elbow").unwrap().ident = 0.25;
    learnt.joints.get_mut("elbow").unwrap().start = 0.25;
    let config = adaptive_with(adaptive::Settings {
        learnt: Some(HereOrFile::Here(learnt.clone())),
        ..settings()
    });
    let mut turned = setup();
    turned.joint_names.reverse();
    let stage = config.stage(turned).unwrap();
    assert_eq!(state(&stage), learnt);
    let mut hit = arm(0.0, 4.0, World::default());
    for sample in &mut hit[900..950] {
        // The elbow is first in this cell, and its learnt bias is 0.25 A.
        sample.effort[0] += 0.8;
    }
    let straight = run(&mut detect(&config), &hit);
    let turned = run(&mut { stage }, &hit);
    let peak = |all: &[Detection]| all[900..950].iter().map(|d| d.score).fold(0.0, f64::max);
    assert!(
        peak(&turned) > 1.5 * peak(&straight),
        "{} {}",
        peak(&turned),
        peak(&straight)
    );
}

#[test]
fn a_reset_clears_all_but_what_was_learnt() {
    let hit = World {
        collision: Some((9.5, 0.4, 4.0)),
        ..World::default()
    };
    let mut used = detect(&basic());
    // Ends in the middle of the alarm.
    run(&mut used, &arm(0.0, 9.6, hit));
    let after = arm(30.0, 8.0, World::default());
    let verdicts = run(&mut used, &after);
    assert_eq!(verdicts[0].event(), EventKind::Offset);
    let fresh = run(&mut detect(&basic()), &after);
    assert_eq!(verdicts[1..], fresh[1..]);
}

#[test]
fn the_bias_is_learnt_from_what_is_free_of_contact() {
    let clean = Lesson {
        name: "clean".to_owned(),
        samples: arm(0.0, 24.0, World::default()),
        contacts: Some(Vec::new()),
    };
    let hit = World {
        collision: Some((9.5, 0.4, 4.0)),
        ..World::default()
    };
    let mut touched = Lesson {
        samples: arm(0.0, 24.0, hit),
        ..clean.clone()
    };
    touched.contacts = Some(vec![LabelledContact {
        on_ns: 9_490_000_000,
        off_ns: 9_900_000_000,
        kind: ContactKind::Collision,
        ignore: false,
    }]);
    let biases = [&clean, &touched].map(|lesson| {
        let lessons = Lessons {
            train: std::slice::from_ref(lesson),
            validation: &[],
        };
        let learnt = basic::learn(&basic::Settings::default(), &setup(), &lessons).unwrap();
        let full = adaptive::learn(&adaptive::Settings::default(), &setup(), &lessons).unwrap();
        assert_eq!(full.bias, learnt.bias);
        let joints = full.learnt.as_ref().unwrap().here().unwrap().joints.clone();
        assert!(joints.values().all(|joint| joint.adapt_s == Some(0.0)));
        // Neither raises an alarm in another run of the same cycle.
        for config in [basic_with(learnt.clone()), adaptive_with(full)] {
            let verdicts = run(&mut detect(&config), &arm(40.0, 24.0, World::default()));
            assert!(alarms(&verdicts).is_empty());
        }
        match learnt.bias.unwrap() {
            FirstBias::ByName(bias) => JOINTS.map(|name| bias[name]),
            other @ FirstBias::InOrder(_) => panic!("{other:?}"),
        }
    });
    for (clean, touched) in biases[0].iter().zip(&biases[1]) {
        assert!((touched / clean - 1.0).abs() < 0.5, "{biases:?}");
    }
}

#[test]
fn what_does_not_fit_is_refused_in_words() {
    let refused = |config: &Config| config.stage(setup()).err().unwrap();
    let error = refused(&basic_with(basic::Settings::default()));
    assert!(matches!(error, ConfigError::NoBias { .. }));
    let three = basic::Settings {
        bias: Some(FirstBias::InOrder(vec![1.0; 3])),
        ..basic::Settings::default()
    };
    let text = refused(&basic_with(three)).to_string();
    assert!(
        text.contains("3 numbers") && text.contains("2 joints"),
        "{text}"
    );
    let elsewhere = [("shoulder".to_owned(), 1.0), ("wrist".to_owned(), 1.0)];
    let elsewhere = basic::Settings {
        bias: Some(FirstBias::ByName(elsewhere.into())),
        ..basic::Settings::default()
    };
    let text = refused(&basic_with(elsewhere)).to_string();
    assert!(
        text.contains("is of the joints shoulder, wrist, but the cell has shoulder, elbow"),
        "{text}"
    );
    let mut unsound = learnt_on(JOINTS);
    unsound.joints.get_mut("elbow").unwrap().ident = f64::NAN;
    for (learnt, said) in [
        (learnt_on([]), "but the cell has shoulder, elbow"),
        (learnt_on(["elbow"]), "is of the joints elbow, but"),
        (
            learnt_on(["elbow", "wrist"]),
            "is of the joints elbow, wrist, but",
        ),
        (unsound, "of the joint elbow holds a number"),
    ] {
        let other = adaptive::Settings {
            learnt: Some(HereOrFile::Here(learnt)),
            ..settings()
        };
        let text = refused(&adaptive_with(other)).to_string();
        assert!(text.contains(said), "{text}");
    }
    let short = Lesson {
        samples: arm(0.0, 3.0, World::default()),
        ..Lesson::default()
    };
    let lessons = Lessons {
        train: &[short],
        validation: &[],
    };
    let error = basic::learn(&basic::Settings::default(), &setup(), &lessons).unwrap_err();
    assert!(matches!(error, LearnError::TooLittle { .. }));
}
