//! `tauscope` behind a twin without friction and with delay.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::{Out, setup};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{Detection, EventKind, JointArray, Stage, TwinState, flags};
use tauscope_detect::{Config, Lesson, Lessons, tauscope};

const JOINTS: usize = 2;
const STEP_NS: i64 = 10_000_000;

/// Returns samples of an arm with swinging joints, noise of 0.05 and friction `rubs` by velocity and time \[s\].
fn swinging(seed: u64, seconds: i64, rubs: impl Fn(f64, f64) -> f64) -> Vec<TwinState> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let phases: [f64; JOINTS] = std::array::from_fn(|_| random.random_range(0.0..6.0));
    (0..seconds * 100)
        .map(|k| {
            let time_s = 0.01 * k as f64;
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k * STEP_NS;
            sample.header.joint_count = JOINTS as u32;
            sample.header.flags = flags::READY;
            for (j, phase) in phases.iter().enumerate() {
                sample.velocity[j] = (1.3 * time_s + phase).sin();
                let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                sample.effort[j] = 0.05 * noise + rubs(sample.velocity[j], time_s);
            }
            sample
        })
        .collect()
}

/// Returns Coulomb friction of 1.2 plus viscous friction of 0.5.
fn friction(velocity: f64) -> f64 {
    1.2 * (velocity / 0.03).tanh() + 0.5 * velocity
}

fn learnt(all: impl IntoIterator<Item = Vec<TwinState>>) -> tauscope::Settings {
    let lesson = |samples| Lesson {
        name: "rec".to_owned(),
        samples,
        contacts: Some(Vec::new()),
    };
    let train: Vec<Lesson> = all.into_iter().map(lesson).collect();
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap()
}

fn run(settings: tauscope::Settings, samples: &[TwinState]) -> Vec<Detection> {
    let config = Config::of(settings);
    let mut detector = config.stage(setup(JOINTS)).unwrap();
    let mut out = Out::default();
    for sample in samples {
        detector.accept(sample, &mut out).unwrap();
    }
    out.0
}

fn onsets(said: &[Detection]) -> Vec<usize> {
    let is_onset = |k: &usize| said[*k].event() == EventKind::Onset;
    (0..said.len()).filter(is_onset).collect()
}

#[test]
fn a_push_that_is_small_beside_friction_is_found() {
    let rubs = |velocity, _| friction(velocity);
    let learnt = learnt((1..5).map(|seed| swinging(seed, 30, rubs)));
    let mut samples = swinging(9, 20, rubs);
    for sample in &mut samples[1000..1060] {
        sample.effort[1] -= 0.3;
    }
    let onsets = onsets(&run(learnt, &samples));
    assert_eq!(onsets.len(), 1, "{onsets:?}");
    assert!((1000..1010).contains(&onsets[0]), "{onsets:?}");
}

#[test]
fn friction_that_falls_by_a_third_while_the_arm_warms_up_is_no_contact() {
    let cold = |velocity, _| friction(velocity);
    let learnt = learnt((1..5).map(|seed| swinging(seed, 30, cold)));
    let warms_up =
        |velocity, time_s: f64| friction(velocity) * (1.0 - 0.33 * (1.0 - (-time_s / 300.0).exp()));
    let onsets = onsets(&run(learnt, &swinging(9, 900, warms_up)));
    // At the tolerated five false alarms per hour, a quarter of an hour has at most two or three by chance.
    assert!(onsets.len() <= 3, "{onsets:?}");
}

#[test]
fn what_does_not_come_back_in_other_recordings_is_not_learnt() {
    // Each recording has another dependence on the velocity.
    let all = (1..5).map(|seed| {
        let sign = if seed % 2 == 0 { 1.0 } else { -1.0 };
        swinging(seed, 30, move |velocity, _| sign * friction(velocity))
    });
    let settings = learnt(all);
    assert!(
        settings
            .learnt()
            .unwrap()
            .joints
            .iter()
            .all(|joint| joint.usual.is_none())
    );
}

/// Adds an effort to the measurement, and to the twin with a delay of `late` samples.
fn driven(mut samples: Vec<TwinState>, late: usize) -> Vec<TwinState> {
    // Steps between 0 and 2.5, as for a joint that accelerates and brakes.
    let drive = |k: usize| {
        if (k / 100).is_multiple_of(2) {
            2.5
        } else {
            0.0
        }
    };
    let ramp = |k: usize| (0..10).map(|i| drive(k.saturating_sub(i))).sum::<f64>() / 10.0;
    for (k, sample) in samples.iter_mut().enumerate() {
        let mut both = [0.0; 2];
        for (of, k) in both.iter_mut().zip([k, k.saturating_sub(late)]) {
            *of = ramp(k);
        }
        let add = |efforts: &mut JointArray, by: f64| {
            for effort in &mut efforts[..JOINTS] {
                *effort += by;
            }
        };
        add(&mut sample.effort, both[0]);
        add(&mut sample.expected_effort, both[1]);
    }
    samples
}

#[test]
fn a_twin_that_is_late_where_the_arm_is_driven_does_not_hide_a_push_where_it_is_not() {
    let arm = |seed| driven(swinging(seed, 30, |_, _| 0.0), 2);
    let learnt = learnt((1..5).map(arm));
    let mut samples = arm(9);
    // The driving effort changed by 2.5 at 10 s and 11 s, and the residual by half of that.
    for sample in &mut samples[1050..1090] {
        sample.effort[1] -= 0.3;
    }
    let onsets = onsets(&run(learnt, &samples));
    assert_eq!(onsets.len(), 1, "{onsets:?}");
    assert!((1050..1090).contains(&onsets[0]), "{onsets:?}");
}
