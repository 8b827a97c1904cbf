//! What is told of remainders.

use super::*;
use crate::fixture::{Noise, at_joint, model, problem, recording};

/// What is said of recordings of two joints in which `add` is added to the first joint's effort, given the number of
/// the recording, its sample and the joint's position. The last recording is held out.
fn remainders(add: impl FnMut(u64, usize, f64) -> f64) -> Remainders {
    remainders_beside(add, || 0.0)
}

/// The same, with `beside` added to the effort of the other joint.
fn remainders_beside(
    mut add: impl FnMut(u64, usize, f64) -> f64,
    mut beside: impl FnMut() -> f64,
) -> Remainders {
    let model = model();
    let mut noise = Noise(11);
    let mut of = |seed: u64| {
        let mut k = 0;
        recording(&model, seed, |q, _, effort| {
            effort[0] += add(seed, k, q[0]) + 0.05 * noise.next();
            effort[1] += beside() + 0.05 * noise.next();
            k += 1;
        })
    };
    let fitted = problem(&model, &[of(1), of(2), of(3)]);
    let held = problem(&model, &[of(4)]);
    let (here, there) = (Fit::new(&fitted, Vec::new()), Fit::new(&held, Vec::new()));
    let left = |problem, fit| Left { problem, fit };
    let joints = ["shoulder".to_owned(), "elbow".to_owned()];
    let (found, held) = (left(&fitted, &here), left(&held, &there));
    of_all(found, held, &here, &joints)
}

fn of_all(found: Left<'_>, held: Left<'_>, before: &Fit, joints: &[String]) -> Remainders {
    let uncorrected = Fit::new(held.problem, before.actives.clone());
    let before = Before {
        fit: before,
        held: Some(&uncorrected),
    };
    of(found, before, Some(held), &[1.0, 1.0], joints, "N m")
}

/// Noise whose deviation is about 2, and which fades within a second.
fn slow_noise(seed: u64) -> impl FnMut() -> f64 {
    let (mut noise, mut slow) = (Noise(seed), 0.0);
    move || {
        slow = 0.99 * slow + 0.14 * noise.next();
        2.0 * slow
    }
}

#[test]
fn slow_noise_of_all_joints_is_no_remainder_however_large() {
    let mut slow = slow_noise(5);
    let found = remainders_beside(|_, _, _| slow(), slow_noise(6));
    assert!(found.all.is_empty(), "{:?}", found.all);
}

#[test]
fn what_one_joint_alone_leaves_is_a_remainder_although_nothing_predicts_it() {
    let mut slow = slow_noise(5);
    let found = remainders(|_, _, _| slow());
    let [one] = &found.all[..] else {
        panic!("{:?}", found.all)
    };
    assert_eq!(one.joint, "shoulder");
    assert!(
        one.sentence.contains("where most joints leave"),
        "{}",
        one.sentence
    );
}

#[test]
fn what_follows_the_motion_is_a_remainder_and_is_told_with_what_it_goes() {
    let found = remainders(|_, _, q| 0.8 * (4.0 * q).sin());
    let [one] = &found.all[..] else {
        panic!("{:?}", found.all)
    };
    assert_eq!(one.joint, "shoulder");
    assert!(
        one.sentence.contains("its own position"),
        "{}",
        one.sentence
    );
    assert!(one.rms > 5.0 * one.noise);
}

#[test]
fn what_is_larger_on_held_out_recordings_alone_is_a_remainder() {
    let mut noise = Noise(7);
    let mut slow = 0.0;
    let found = remainders(|recording, _, _| {
        slow = 0.99 * slow + 0.14 * noise.next();
        if recording == 4 {
            3.0 * slow
        } else {
            0.1 * slow
        }
    });
    assert_eq!(found.elsewhere, [0]);
    let said = &found.all[0].sentence;
    assert!(said.contains("On the held-out recordings"), "{said}");
}

#[test]
fn held_out_recordings_like_the_worst_fitted_one_have_no_remainder() {
    let mut noise = Noise(9);
    let mut slow = 0.0;
    let found = remainders(|recording, _, _| {
        slow = 0.99 * slow + 0.14 * noise.next();
        if recording > 2 {
            1.5 * slow
        } else {
            0.1 * slow
        }
    });
    assert!(found.elsewhere.is_empty(), "{:?}", found.all);
}

#[test]
fn knocks_are_told_with_their_time() {
    let knocked = |k: usize| (200..230).contains(&(k % 400));
    let found = remainders(|_, k, _| if knocked(k) { 9.0 } else { 0.0 });
    let said = &found.all[0].sentence;
    assert!(said.contains("stands out for moments"), "{said}");
}

#[test]
fn a_correction_that_makes_held_out_recordings_worse_is_told() {
    let model = model();
    let mut noise = Noise(13);
    // The friction that was fitted is not there on the held-out recording.
    let mut of = |seed: u64| {
        recording(&model, seed, |_, qd, effort| {
            effort[0] += if seed < 4 { 2.0 * qd[0] } else { 0.0 } + 0.05 * noise.next();
            effort[1] += 0.05 * noise.next();
        })
    };
    let fitted = problem(&model, &[of(1), of(2), of(3)]);
    let held = problem(&model, &[of(4)]);
    let before = Fit::new(&fitted, Vec::new());
    let friction = at_joint("viscous_friction", 0).with(vec![2.0]);
    let here = Fit::new(&fitted, vec![friction.clone()]);
    let there = Fit::new(&held, vec![friction]);
    let joints = ["shoulder".to_owned(), "elbow".to_owned()];
    let left = |problem, fit| Left { problem, fit };
    let found = of_all(left(&fitted, &here), left(&held, &there), &before, &joints);
    let said = &found.all[0].sentence;
    assert!(said.contains("worse than the twin as it was"), "{said}");
}
