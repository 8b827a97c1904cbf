#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use super::*;
use crate::ros::{Header, Time};

/// Returns the facts of a joint that swings by half a radian, with its velocity multiplied by `slope` and its
/// position by `units`.
fn swing(slope: f64, units: f64) -> JointFacts {
    let mut tallies = JointTallies::default();
    for i in 0..1000_u32 {
        let t = f64::from(i) * 0.01;
        let state = JointState {
            header: Header {
                stamp: Time::from_ns(i64::from(i) * 10_000_000),
                ..Header::default()
            },
            name: vec!["elbow".to_owned()],
            position: vec![0.5 * t.sin() * units],
            velocity: vec![0.5 * t.cos() * slope],
            effort: vec![0.0],
        };
        tallies.add(&state);
    }
    tallies.facts().remove(0)
}

#[test]
fn a_velocity_that_is_the_derivative_is_not_remarked() {
    let facts = swing(1.0, 1.0);
    assert!((facts.velocity_slope.unwrap() - 1.0).abs() < 1e-3);
    assert!(!facts.has_odd_velocity());
    assert!(facts.effort_is_zero);
}

#[test]
fn half_a_velocity_a_turned_one_and_degrees_are_remarked() {
    for (velocity, slope) in [(0.5, 0.5), (-1.0, -1.0)] {
        let facts = swing(velocity, 1.0);
        assert!(facts.has_odd_velocity() && (facts.velocity_slope.unwrap() - slope).abs() < 1e-3);
    }
    assert!(swing(1.0, 180.0 / std::f64::consts::PI).is_in_degrees());
}

#[test]
fn repeats_and_stamps_that_step_back_are_counted() {
    let at = |ns: i64, position: f64| JointState {
        header: Header {
            stamp: Time::from_ns(ns),
            ..Header::default()
        },
        name: vec!["elbow".to_owned()],
        position: vec![position],
        velocity: Vec::new(),
        effort: Vec::new(),
    };
    let mut tallies = JointTallies::default();
    for state in [at(10, 0.0), at(10, 0.0), at(20, 0.1), at(15, 0.2)] {
        tallies.add(&state);
    }
    assert_eq!((tallies.repeated, tallies.backward), (1, 1));
}

/// Returns the facts of a joint that swings, sampled at 100 Hz, with `change` applied to each sample.
fn swing_with(change: impl Fn(u32, &mut JointState)) -> JointFacts {
    let mut tallies = JointTallies::default();
    for i in 0..1000_u32 {
        let t = f64::from(i) * 0.01;
        let mut state = JointState {
            header: Header {
                stamp: Time::from_ns(5_000_000_000 + i64::from(i) * 10_000_000),
                ..Header::default()
            },
            name: vec!["elbow".to_owned()],
            position: vec![0.5 * t.sin()],
            velocity: vec![0.5 * t.cos()],
            effort: vec![1.0],
        };
        change(i, &mut state);
        tallies.add(&state);
    }
    tallies.facts().remove(0)
}

#[test]
fn a_jump_is_named_in_place_of_the_velocity() {
    let glitch = swing_with(|i, state| {
        if i == 321 {
            state.position[0] += 1.5;
        }
    });
    let remark = "the position of elbow jumps by 1.500 rad or m at 3.210 s, and back after 0.010 s";
    assert!(!glitch.has_odd_velocity());
    assert_eq!(glitch.jump_remark().unwrap(), remark);
    let stays = swing_with(|i, state| state.position[0] -= if i < 700 { 0.0 } else { 0.2 });
    let remark = "the position of elbow jumps by -0.200 rad or m at 7.000 s";
    assert_eq!(stays.jump_remark().unwrap(), remark);
    let wraps = swing_with(|i, state| {
        let turns = [0.0, 1.0, 2.0][(i / 400) as usize];
        state.position[0] += turns * std::f64::consts::TAU;
    });
    let remark = "the position of elbow jumps by 6.283 rad or m at 4.000 s (a whole turn: it wraps, and is read as one motion); it does so once more";
    assert_eq!(wraps.jump_remark().unwrap(), remark);
}

#[test]
fn a_wrong_velocity_is_still_told_beside_a_jump() {
    let facts = swing_with(|i, state| {
        state.velocity[0] *= 0.5;
        state.position[0] += if i < 500 { 0.0 } else { 1.0 };
    });
    assert!(facts.jump_remark().is_some() && facts.has_odd_velocity());
}

#[test]
fn more_jumps_than_can_be_kept_say_nothing_of_the_velocity() {
    let facts = swing_with(|i, state| state.position[0] += f64::from(i / 40));
    assert!(
        facts
            .jump_remark()
            .unwrap()
            .ends_with("it does so at least 7 more times")
    );
    assert!(!facts.has_odd_velocity());
}

#[test]
fn what_is_no_number_is_told_by_joint_and_field_with_count_and_time() {
    let facts = swing_with(|i, state| match i {
        100..110 => state.effort[0] = f64::NAN,
        200 => state.velocity[0] = f64::INFINITY,
        _ => {}
    });
    let remarks = [
        "the velocity of elbow is NaN or infinite in 1 message at 2.000 s",
        "the effort of elbow is NaN in 10 messages from 1.000 s to 1.090 s",
    ];
    let told = facts.not_finite.iter();
    let told: Vec<String> = told.map(|it| it.in_words(&facts.name)).collect();
    assert_eq!(told, remarks);
}

#[test]
fn a_joint_that_is_named_twice_is_told_with_both_places() {
    let names = ["base", "elbow", "base"].map(str::to_owned).to_vec();
    let state = JointState {
        position: vec![0.0; names.len()],
        name: names,
        ..JointState::default()
    };
    let mut tallies = JointTallies::default();
    tallies.add(&state);
    tallies.add(&state);
    let told = tallies.twice().unwrap().to_string();
    assert_eq!(
        told,
        "2 messages name joint `base` twice, as entries 1 and 3 of `name`"
    );
}
