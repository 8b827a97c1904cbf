//! `tauscope` behind a twin with a delayed acceleration.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::Out;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{EventKind, Stage, TwinState, flags};
use tauscope_detect::{Config, Lesson, Lessons, Setup, tauscope};
use tauscope_dynamics::Model;

/// One upright joint; its inertia is 0.6 kg m².
const ARM: &str = r#"<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="joint1" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/></joint>
</robot>"#;
const INERTIA_KG_M2: f64 = 0.6;
/// Time constant of the twin's acceleration \[s\].
const LATE_S: f64 = 0.02;
const STEPS: usize = 10;

fn setup(knows_arm: bool) -> Setup {
    Setup {
        model: knows_arm.then(|| Model::from_urdf(ARM).unwrap()),
        ..crate::common::setup(1)
    }
}

/// Returns samples of a swinging arm with an additional acceleration `also` over time \[s, rad/s²\] and noise of
/// 0.05 N m.
fn swinging(seed: u64, seconds: usize, also: impl Fn(f64) -> f64) -> Vec<TwinState> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let phase: f64 = random.random_range(0.0..6.0);
    let acceleration = |time_s: f64| (1.3 * time_s + phase).cos() + also(time_s);
    let (mut velocity, mut late) = (phase.sin() / 1.3, phase.cos());
    (0..seconds * 100)
        .map(|k| {
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k as i64 * 10_000_000;
            sample.header.joint_count = 1;
            sample.header.flags = flags::READY;
            for i in 1..=STEPS {
                let dt_s = 0.01 / STEPS as f64;
                let now = acceleration(0.01 * k as f64 + dt_s * i as f64);
                velocity += now * dt_s;
                late += (now - late) * dt_s / LATE_S;
            }
            let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
            sample.velocity[0] = velocity;
            sample.acceleration[0] = late;
            sample.expected_effort[0] = INERTIA_KG_M2 * late;
            sample.effort[0] = INERTIA_KG_M2 * acceleration(0.01 * (k + 1) as f64) + 0.05 * noise;
            sample
        })
        .collect()
}

/// Returns the number of contacts that a detector, trained on a swinging arm, detects in `samples`.
fn onsets(setup: &Setup, samples: &[TwinState]) -> usize {
    let lesson = |seed| Lesson {
        name: "rec".to_owned(),
        samples: swinging(seed, 30, |_| 0.0),
        contacts: Some(Vec::new()),
    };
    let train: Vec<Lesson> = (1..5).map(lesson).collect();
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let learnt = tauscope::learn(&tauscope::Settings::default(), setup, &lessons).unwrap();
    let config = Config::of(learnt);
    let mut detector = config.stage(setup.clone()).unwrap();
    let mut out = Out::default();
    for sample in samples {
        detector.accept(sample, &mut out).unwrap();
    }
    let is_onset = |said: &&tauscope_bus::Detection| said.event() == EventKind::Onset;
    out.0.iter().filter(is_onset).count()
}

/// Returns the acceleration of an arm that jerks forward at 10 s and stops again \[rad/s²\].
fn leap(time_s: f64) -> f64 {
    match time_s {
        10.0..10.2 => 6.0 * (std::f64::consts::TAU * (time_s - 10.0) / 0.2).sin(),
        _ => 0.0,
    }
}

#[test]
fn an_arm_that_leaps_as_it_never_did_is_not_touched() {
    let leaps = swinging(9, 20, leap);
    assert_eq!(onsets(&setup(true), &leaps), 0);
    // The residual alone does not distinguish a jerk from a contact.
    assert!(onsets(&setup(false), &leaps) > 0);
}

#[test]
fn what_stops_an_arm_is_a_contact() {
    let mut samples = swinging(9, 20, leap);
    // The measured effort does not drive the jerk: an external force does.
    for sample in &mut samples[1000..1020] {
        sample.effort[0] = sample.expected_effort[0];
    }
    assert!(onsets(&setup(true), &samples) > 0);
}
