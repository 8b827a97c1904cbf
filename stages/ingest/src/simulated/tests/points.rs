//! Teaching points by inverse kinematics, and cyclic moves.

#![allow(clippy::float_cmp, reason = "what is the same must be the same bits")]

use nalgebra::Isometry3;
use tauscope_dynamics::{Data, forward_kinematics, link_pose};

use super::*;

const POSTURE: [f64; N] = [0.0, 0.6, 0.0, 1.2, 0.0, 0.9, 0.0];

/// Returns the pose of the tool.
fn tool(position: &[f64]) -> Isometry3<f64> {
    let (model, mut data) = (arm(), Data::new(&arm()));
    forward_kinematics(&model, &mut data, &position[..N]);
    link_pose(&model, &data, model.tool_link())
}

/// Returns the positions at which the arm rests: commands that are equal in two successive readings.
fn stops(scenario: &Scenario) -> Vec<[f64; N]> {
    let readings = readings(scenario);
    let mut stops: Vec<[f64; N]> = Vec::new();
    for pair in readings.windows(2) {
        let at: [f64; N] = std::array::from_fn(|j| pair[1].command_position[j]);
        let still = pair[0].command_position == pair[1].command_position;
        if still && stops.last() != Some(&at) {
            stops.push(at);
        }
    }
    stops
}

fn within(seed: u64, more: &str) -> Scenario {
    let mut scenario = ideal(
        &format!(
            "duration_s: 25, motion: {{points: {{speed: 0.5, rest_s: [0.1, 0.1], \
             reach: {{posture: {POSTURE:?}}}, within: {{radius_m: 0.2 {more}}}}}}}"
        ),
        "",
    );
    scenario.seed = seed;
    scenario
}

#[test]
fn random_points_lie_within_the_radius_and_the_limits() {
    let centre = tool(&POSTURE);
    let stops = stops(&within(5, ", turn_rad: 0.3"));
    assert!(stops.len() > 8, "{}", stops.len());
    let mut farthest = 0.0_f64;
    for stop in &stops {
        let pose = tool(stop);
        let distance = (pose.translation.vector - centre.translation.vector).norm();
        farthest = farthest.max(distance);
        assert!(distance < 0.2 + 1e-5, "{stop:?}: {distance}");
        assert!(
            pose.rotation.angle_to(&centre.rotation) < 0.3 + 1e-5,
            "{stop:?}"
        );
        for (value, joint) in stop.iter().zip(arm().joints()) {
            let [lower, upper] = [joint.limits.lower, joint.limits.upper].map(Option::unwrap);
            assert!((lower..=upper).contains(value), "{stop:?}");
        }
    }
    assert!(farthest > 0.1, "{farthest}");
    assert_eq!(stops, super::points::stops(&within(5, ", turn_rad: 0.3")));
    assert_ne!(
        stops[0],
        super::points::stops(&within(6, ", turn_rad: 0.3"))[0]
    );
}

#[test]
fn a_number_of_points_is_gone_through_again_and_again() {
    let stops = stops(&within(5, ", count: 3"));
    assert!(stops.len() > 6, "{}", stops.len());
    for (i, stop) in stops.iter().enumerate() {
        for j in 0..N {
            assert!((stop[j] - stops[i % 3][j]).abs() < 1e-9, "{i}: {stop:?}");
        }
    }
}

fn places(places: &str, more: &str) -> Scenario {
    ideal(
        &format!(
            "duration_s: 20, motion: {{points: {{through_m: {places}, rest_s: [0.4, 0.4], \
             reach: {{posture: {POSTURE:?}}}, {more}}}}}"
        ),
        "",
    )
}

#[test]
fn given_places_are_reached_with_the_posture_s_orientation() {
    let stops = stops(&places("[[0.4, 0.1, 0.5], [0.5, -0.2, 0.4]]", ""));
    for (stop, place) in stops.iter().zip([[0.4, 0.1, 0.5], [0.5, -0.2, 0.4]]) {
        let pose = tool(stop);
        assert!((pose.translation.vector - nalgebra::Vector3::from(place)).norm() < 1e-5);
        assert!(pose.rotation.angle_to(&tool(&POSTURE).rotation) < 1e-5);
    }
}

#[test]
fn cycles_repeat_and_end() {
    let scenario = places(
        "[[0.4, 0.1, 0.5], [0.5, -0.2, 0.4], [0.5, 0.2, 0.4]]",
        "cycles: 3",
    );
    let mut simulation = Simulation::new(&scenario, &arm(), 0).unwrap();
    let cycle_s = simulation.cycle_s().unwrap();
    assert!((2.0..6.0).contains(&cycle_s), "{cycle_s}");
    let readings: Vec<_> = std::iter::from_fn(|| simulation.next_reading().unwrap()).collect();
    let at = |t_s: f64| readings[(t_s * 1000.0).round() as usize].command_position;
    let mut moved = 0.0_f64;
    for k in 0..(2.0 * cycle_s / 0.01) as usize {
        let t_s = k as f64 * 0.01;
        let (now, next) = (at(t_s), at(t_s + cycle_s));
        for j in 0..N {
            // Readings are a millisecond apart, a cycle is not whole milliseconds.
            assert!((now[j] - next[j]).abs() < 1e-3, "{t_s} s, joint {j}");
            moved = moved.max((now[j] - at(0.0)[j]).abs());
        }
    }
    assert!(moved > 0.1);
    let end = 3.0 * cycle_s + 0.4;
    assert_ne!(at(end - 0.5 - 0.4), at(0.0));
    assert!(
        readings[(end * 1000.0) as usize + 1..]
            .iter()
            .all(|r| r.command_position == at(0.0))
    );
}

fn refused(scenario: &Scenario) -> String {
    Simulation::new(scenario, &arm(), 0)
        .unwrap_err()
        .to_string()
}

#[test]
fn what_cannot_be_reached_is_said_plainly() {
    let error = refused(&places("[[0.4, 0.1, 0.5], [2.0, 0, 0.5]]", ""));
    assert!(
        error.contains("motion.points.through_m, point 2"),
        "{error}"
    );
    assert!(
        error.contains("link `tool` cannot reach [2, 0, 0.5] m"),
        "{error}"
    );
    assert!(error.contains("reach.any_orientation"), "{error}");
    let error = refused(&within(1, ", about_m: [0, 0, 3]"));
    assert!(error.contains("motion.points.within.about_m"), "{error}");
}

#[test]
fn motions_that_contradict_themselves_are_refused_with_what_to_do() {
    let points = |points: &str| {
        ideal(
            &format!("duration_s: 5, motion: {{points: {{{points}}}}}"),
            "",
        )
    };
    for (scenario, words) in [
        (points("cycles: 3"), ["motion.points.cycles", "`through_m`"]),
        (
            points("through_m: [[0.4, 0, 0.5]], within: {radius_m: 0.1}"),
            ["motion.points", "at most one"],
        ),
        (points("reach: {}"), ["motion.points", "`reach`"]),
        (
            points("through_m: [[0.4, 0, 0.5]], reach: {posture: [0, 0]}"),
            ["reach.posture", "7 joints"],
        ),
        (
            points("through_m: [[0.4, 0, 0.5]], reach: {link: hand}"),
            ["motion.points.reach", "`hand`"],
        ),
        (
            places("[[0.4, 0.1, 0.5], [0.5, -0.2, 0.4]]", "cycles: 30"),
            ["motion.points.cycles", "take fewer cycles"],
        ),
    ] {
        let error = refused(&scenario);
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    }
}
