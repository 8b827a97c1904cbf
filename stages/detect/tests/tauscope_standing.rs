//! `tauscope` on an arm at standstill, where static friction takes any value within its limits.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use crate::common::{Out, setup};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tauscope_bus::{EventKind, Stage, TwinState, flags};
use tauscope_detect::{Config, Detect, Lesson, Lessons, tauscope};

const JOINTS: usize = 3;
const STEP_NS: i64 = 10_000_000;

/// Draws the unknown static friction of each joint after the arm has come to rest.
fn held(random: &mut ChaCha8Rng) -> [f64; JOINTS] {
    std::array::from_fn(|_| random.random_range(-2.0..2.0))
}

/// Returns samples of an arm that alternately stands for 6 s and moves for 4 s.
fn arm(seed: u64, seconds: i64) -> Vec<TwinState> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut friction = held(&mut random);
    let mut position = 0.0;
    (0..seconds * 100)
        .map(|k| {
            let moves = k % 1000 >= 600;
            if k % 1000 == 999 {
                friction = held(&mut random);
            }
            let mut sample = TwinState::default();
            sample.header.stamp_ns = k * STEP_NS;
            sample.header.joint_count = JOINTS as u32;
            sample.header.flags = flags::READY;
            let speed = if moves { 0.5 } else { 0.0 };
            position += 0.01 * speed;
            for (j, held) in friction.iter().enumerate() {
                sample.position[j] = position;
                sample.velocity[j] = speed;
                let noise: f64 = (0..12).map(|_| random.random_range(-0.5..0.5)).sum();
                let error = if moves {
                    // Friction in motion that the twin does not model.
                    1.5 * (0.05 * k as f64 + j as f64).sin()
                } else {
                    *held
                };
                sample.effort[j] = 0.05 * noise + error;
            }
            sample
        })
        .collect()
}

/// Returns a detector trained on an arm that stands and moves.
fn detector() -> Detect {
    taught_by(|seed| arm(seed, 60))
}

fn taught_by(arm: impl Fn(u64) -> Vec<TwinState>) -> Detect {
    let lesson = |seed| Lesson {
        name: "rec".to_owned(),
        samples: arm(seed),
        contacts: Some(Vec::new()),
    };
    let train = [lesson(1), lesson(2), lesson(3)];
    let lessons = Lessons {
        train: &train,
        validation: &[],
    };
    let settings =
        tauscope::learn(&tauscope::Settings::default(), &setup(JOINTS), &lessons).unwrap();
    let config = Config::of(settings);
    config.stage(setup(JOINTS)).unwrap()
}

/// Returns the start and end of each alarm \[s\].
fn alarms(samples: &[TwinState]) -> Vec<(f64, f64)> {
    alarms_of(detector(), samples)
}

fn alarms_of(mut detector: Detect, samples: &[TwinState]) -> Vec<(f64, f64)> {
    let mut out = Out::default();
    for sample in samples {
        detector.accept(sample, &mut out).unwrap();
    }
    let at = |kind| {
        let of_kind = out.0.iter().filter(move |said| said.event() == kind);
        of_kind.map(|said| said.header.stamp_ns as f64 * 1e-9)
    };
    at(EventKind::Onset).zip(at(EventKind::Offset)).collect()
}

#[test]
fn a_push_that_is_small_beside_what_friction_may_hold_is_found_while_the_arm_stands() {
    let mut samples = arm(7, 6);
    for sample in &mut samples[300..400] {
        sample.effort[1] -= 1.0;
    }
    let alarms = alarms(&samples);
    assert_eq!(alarms.len(), 1, "{alarms:?}");
    let (on_s, off_s) = alarms[0];
    assert!(
        (3.0..3.2).contains(&on_s) && (4.0..4.4).contains(&off_s),
        "{alarms:?}"
    );
}

#[test]
fn where_a_push_leaves_friction_otherwise_than_it_was_it_is_over_all_the_same_and_the_next_one_is_found()
 {
    let mut samples = arm(7, 6);
    for (k, sample) in samples.iter_mut().enumerate().skip(250) {
        let pushed = k < 320 || (450..520).contains(&k);
        // After a push, a third of it remains with the opposite sign and decays.
        let creep = if k < 320 {
            0.0
        } else {
            0.5 * (-0.01 * (k - 320) as f64).exp()
        };
        sample.effort[1] += creep - if pushed { 1.5 } else { 0.0 };
    }
    let alarms = alarms(&samples);
    assert_eq!(alarms.len(), 2, "{alarms:?}");
    assert!(
        (2.5..2.7).contains(&alarms[0].0) && alarms[0].1 < 3.7,
        "{alarms:?}"
    );
    assert!(
        (4.5..4.7).contains(&alarms[1].0) && alarms[1].1 < 5.7,
        "{alarms:?}"
    );
}

#[test]
fn an_arm_that_comes_to_rest_and_starts_again_is_hardly_ever_taken_for_touched() {
    let alarms = alarms(&arm(11, 300));
    // At the tolerated five false alarms per hour, five minutes have none, or one by chance.
    assert!(alarms.len() <= 1, "{alarms:?}");
}

/// Returns samples of an arm whose twin is exact except for noise; it always moves, or always stands.
fn known(seed: u64, seconds: i64, stands: bool) -> Vec<TwinState> {
    let mut samples = arm(seed, seconds);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for (k, sample) in samples.iter_mut().enumerate() {
        for j in 0..JOINTS {
            sample.velocity[j] = if stands { 0.0 } else { 0.5 };
            sample.position[j] = if stands { 0.0 } else { 0.005 * k as f64 };
            sample.effort[j] = 0.05 * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
        }
    }
    samples
}

/// Returns the alarms of a detector trained without standstill.
fn alarms_unseen(samples: &[TwinState]) -> Vec<(f64, f64)> {
    alarms_of(taught_by(|seed| known(seed, 30, false)), samples)
}

#[test]
fn a_contact_is_over_where_it_has_gone_but_for_what_friction_holds_and_the_next_one_is_found() {
    let mut samples = known(7, 12, true);
    for (k, sample) in samples.iter_mut().enumerate().skip(300) {
        let pushed = k < 400 || (700..800).contains(&k);
        sample.effort[1] -= if pushed { 1.5 } else { 0.4 };
    }
    let alarms = alarms_unseen(&samples);
    assert_eq!(alarms.len(), 2, "{alarms:?}");
    let [first, second] = [alarms[0], alarms[1]];
    assert!((3.0..3.1).contains(&first.0) && first.1 < 4.5, "{first:?}");
    assert!(
        (7.0..7.1).contains(&second.0) && second.1 < 8.5,
        "{second:?}"
    );
}

#[test]
fn a_hand_that_keeps_its_force_is_never_forgotten() {
    let mut samples = known(7, 60, true);
    for sample in &mut samples[300..5500] {
        sample.effort[1] -= 1.5;
    }
    let alarms = alarms_unseen(&samples);
    assert_eq!(alarms.len(), 1, "{alarms:?}");
    assert!(
        alarms[0].0 < 3.1 && (55.0..55.5).contains(&alarms[0].1),
        "{alarms:?}"
    );
}
