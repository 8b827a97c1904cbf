//! The Cartesian impedance of Salt Ducaju et al., equations 1 to 3.

use nalgebra::{Isometry3, Vector3};
use tauscope_dynamics::{Data, forward_kinematics, link_pose};

use super::*;

const POSE: &str = "motion: {points: {through: [[0.3, 0.6, 0.2, 1.1, -0.4, 0.7, 0.1]]}}";

/// Returns a function from joint positions to the pose of the tool.
fn tool() -> impl FnMut(&[f64]) -> Isometry3<f64> {
    let (model, mut data) = (arm(), Data::new(&arm()));
    move |position| {
        forward_kinematics(&model, &mut data, &position[..N]);
        link_pose(&model, &data, model.tool_link())
    }
}

/// Readings of an arm that holds a pose by `impedance` while `contacts` push it.
fn held(impedance: &str, duration_s: f64, contacts: &str) -> Vec<Reading> {
    readings(&ideal(
        &format!("duration_s: {duration_s}, {POSE}, contacts: [{contacts}]"),
        &format!("controller: {{impedance: {impedance}}},"),
    ))
}

/// A push on the tool that begins at once and lasts for long, in newtons.
fn push(force: [f64; 3], off_s: f64) -> String {
    format!(
        "{{link: tool, point_m: [0, 0, 0], force_n: {force:?}, t_on_s: 0.1, t_off_s: {off_s}, rise_s: 0.5}}"
    )
}

#[test]
fn a_static_force_displaces_the_tool_by_force_over_stiffness() {
    // The paper's stiffness, and a stiffer one.
    let mut tool = tool();
    for (impedance, stiffness) in [("{}", 150.0), ("{translational_n_per_m: 900}", 900.0)] {
        for force in [[6.0, 0.0, 0.0], [0.0, -5.0, 0.0], [2.0, 3.0, 6.0]] {
            let readings = held(impedance, 6.0, &push(force, 6.0));
            let [first, last] = [readings[0], readings[5400]].map(|r| tool(&r.position));
            let moved = last.translation.vector - first.translation.vector;
            let expected = Vector3::from(force) / stiffness;
            let error = (moved - expected).norm() / expected.norm();
            assert!(
                error < 0.02,
                "{impedance} {force:?}: {moved:?} {expected:?}"
            );
        }
    }
}

#[test]
fn a_static_moment_turns_the_tool_by_the_vector_part_of_the_quaternion() {
    // Two forces a lever apart: 0.3 N m about x, against 10 N m: sin(angle / 2) = 0.03.
    let far = push([0.0, -3.0, 0.0], 9.0).replace("[0, 0, 0]", "[0, 0, 0.1]");
    let pair = format!("{far}, {}", push([0.0, 3.0, 0.0], 9.0));
    let readings = held("{}", 9.0, &pair);
    let mut tool = tool();
    let [first, last] = [readings[0], readings[8400]].map(|r| tool(&r.position));
    let turned = last.rotation * first.rotation.inverse();
    // The lever turns with the tool.
    let lever = last.rotation * Vector3::new(0.0, 0.0, 0.1);
    let moment = lever.cross(&Vector3::new(0.0, -3.0, 0.0));
    let expected = moment / 10.0;
    let vector_part = turned.imag() * turned.w.signum();
    assert!(
        (vector_part - expected).norm() < 0.02 * expected.norm(),
        "{vector_part:?} {expected:?}"
    );
    assert!((turned.angle() - 2.0 * expected.norm().asin()).abs() < 1e-3);
}

#[test]
fn without_friction_the_tool_returns_and_the_elbow_keeps_its_posture() {
    let readings = held(
        "{}",
        12.0,
        "{link: link3, force_n: [0, 25, 0], t_on_s: 0.5, t_off_s: 3, rise_s: 0.5}",
    );
    let mut tool = tool();
    let [first, pushed, last] = [0, 2000, 11_999].map(|ms| readings[ms].position);
    let away = (tool(&pushed).translation.vector - tool(&first).translation.vector).norm();
    let elbow = (0..N)
        .map(|j| (pushed[j] - first[j]).abs())
        .fold(0.0, f64::max);
    assert!(elbow > 0.05, "the arm yields: {elbow}");
    assert!(away < 0.5 * elbow, "more than the tool: {away}");
    for j in 0..N {
        assert!((last[j] - first[j]).abs() < 5e-3, "joint {j}: {last:?}");
    }
}

/// Returns the largest lag of the tool behind a moving reference \[s\].
fn lag_s(damps: &str) -> f64 {
    let scenario = ideal(
        "duration_s: 6, motion: {points: {through: [[0.0, 0.6, 0, 1.1, 0, 0.7, 0], [1.2, 0.6, 0, 1.1, 0, 0.7, 0]], \
         rest_s: [0.5, 0.5], speed: 0.12, acceleration_rad_s2: 3}}",
        &format!("controller: {{impedance: {{damps: {damps}}}}},"),
    );
    let (mut worst, mut tool) = (0.0_f64, tool());
    for reading in readings(&scenario) {
        let ahead = tool(&reading.command_position).translation.vector;
        let behind = ahead - tool(&reading.position).translation.vector;
        worst = worst.max(behind.norm());
    }
    // The first joint swings the tool about the base.
    let radius = tool(&[0.0, 0.6, 0.0, 1.1, 0.0, 0.7, 0.0])
        .translation
        .vector
        .xy()
        .norm();
    worst / (radius * 0.12 * 2.1)
}

#[test]
fn a_damped_motion_follows_two_over_the_root_of_the_stiffness_behind() {
    // 2 / sqrt(150 1/s²), the paper's time constant.
    let behind_s = lag_s("motion");
    assert!((behind_s / 0.163 - 1.0).abs() < 0.15, "{behind_s}");
    let behind_s = lag_s("variation");
    assert!(behind_s < 0.04, "{behind_s}");
}

#[test]
fn the_damping_follows_from_the_stiffness() {
    let by_default = held(
        "{translational_n_per_m: 400}",
        2.0,
        &push([5.0, 0.0, 0.0], 1.0),
    );
    let given = "{translational_n_per_m: 400, translational_ns_per_m: 40, \
                  rotational_nms_per_rad: 6.324555320336759, null_space_nms_per_rad: 6.324555320336759}";
    assert_eq!(by_default, held(given, 2.0, &push([5.0, 0.0, 0.0], 1.0)));
    let less = held(
        "{translational_n_per_m: 400, damping_ratio: 0.3}",
        2.0,
        &push([5.0, 0.0, 0.0], 1.0),
    );
    assert_ne!(by_default, less);
}

#[test]
fn motors_give_no_more_than_their_limits() {
    let limits: Vec<f64> = arm()
        .joints()
        .iter()
        .map(|joint| joint.limits.effort.unwrap())
        .collect();
    let hard = "{link: tool, point_m: [0, 0, 0], force_n: [0, 0, -250], t_on_s: 0.1, t_off_s: 0.2}";
    let readings = held("{translational_n_per_m: 5000}", 0.5, hard);
    let mut at_limit = false;
    for reading in &readings {
        for (j, limit) in limits.iter().enumerate() {
            assert!(reading.effort[j].abs() <= limit + 1e-9, "{reading:?}");
            at_limit |= reading.effort[j].abs() > limit - 1e-9;
        }
    }
    assert!(at_limit);
}

#[test]
fn impedance_and_joint_control_are_not_mixed_up() {
    let mixed = ideal(
        &format!("duration_s: 1, {POSE}"),
        "controller: {natural_hz: 3, impedance: {}},",
    );
    let error = Simulation::new(&mixed, &arm(), 0).unwrap_err().to_string();
    assert!(
        error.contains("`natural_hz`") && error.contains("leave out"),
        "{error}"
    );
    let nowhere = ideal(
        &format!("duration_s: 1, {POSE}"),
        "controller: {impedance: {link: hand}},",
    );
    let error = Simulation::new(&nowhere, &arm(), 0)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("controller.impedance") && error.contains("`hand`"),
        "{error}"
    );
}
