//! Obstacles that the arm runs into, and pushes.

#![allow(clippy::float_cmp, reason = "what is the same must be the same bits")]

use nalgebra::Vector3;
use tauscope_dynamics::{Data, forward_kinematics, link_pose};

use super::*;

/// The tool goes down and up again, 0.24 m, at about (0.42, 0, 0.5).
const DOWN: &str = "motion: {points: {through_m: [[0.42, 0, 0.5], [0.42, 0, 0.26]], rest_s: [0.3, 0.3], \
                    speed: 0.15, reach: {posture: [0, 0.9, 0, 1.4, 0, 0.8, 0]}}}";
const SOFT: &str = "controller: {impedance: {translational_n_per_m: 600}},";

/// Returns the readings, the events at the end, and the places of the tool.
fn run(scenario: &Scenario) -> (Vec<Reading>, Vec<Event>, Vec<Vector3<f64>>) {
    let mut simulation = Simulation::new(scenario, &arm(), 0).unwrap();
    let readings: Vec<_> = std::iter::from_fn(|| simulation.next_reading().unwrap()).collect();
    let (model, mut data) = (arm(), Data::new(&arm()));
    let mut tool = |reading: &Reading| {
        forward_kinematics(&model, &mut data, &reading.position[..N]);
        link_pose(&model, &data, model.tool_link())
            .translation
            .vector
    };
    let places = readings.iter().map(&mut tool).collect();
    (readings, simulation.events().to_vec(), places)
}

fn obstacle(shape: &str, control: &str) -> Scenario {
    ideal(
        &format!("duration_s: 5, {DOWN}, obstacles: [{{{shape}}}]"),
        control,
    )
}

#[test]
fn obstacles_push_and_never_pull() {
    for shape in [
        "plane: {point_m: [0, 0, 0.35], normal: [0, 0, 2]}",
        "box: {center_m: [0.42, 0, 0.15], size_m: [0.3, 0.3, 0.4]}",
        "sphere: {center_m: [0.42, 0, 0.05], radius_m: 0.3}",
    ] {
        let (readings, events, places) = run(&obstacle(shape, SOFT));
        let free = run(&ideal(&format!("duration_s: 5, {DOWN}"), SOFT));
        assert_eq!(free.1, []);
        let lowest = |places: &[Vector3<f64>]| places.iter().map(|p| p.z).fold(1.0, f64::min);
        assert!(lowest(&free.2) < 0.27, "{}", lowest(&free.2));
        // 600 N/m against 10 000 N/m: it goes 5 mm into it, and no more.
        assert!(
            (0.335..0.35).contains(&lowest(&places)),
            "{shape}: {}",
            lowest(&places)
        );
        let event = &events[0];
        assert_eq!(
            (event.kind, event.link.as_str()),
            (ContactKind::Collision, "tool")
        );
        assert!(event.force_n[2] > 20.0, "{shape}: {event:?}");
        assert!(
            event.force_n[0].abs() < 0.2 * event.force_n[2],
            "{shape}: {event:?}"
        );
        assert!(
            (event.point_m[2] - 0.345).abs() < 0.01,
            "{shape}: {event:?}"
        );
        // Before the contact begins everything is as it would be without.
        let mut before = 0;
        for (with, without) in readings.iter().zip(&free.0) {
            let at_s = (with.stamp_ns - readings[0].stamp_ns) as f64 * 1e-9;
            if at_s <= event.on_s {
                assert_eq!(with.position, without.position, "{shape}: {at_s}");
                before += 1;
            }
            let inside = event.on_s + 1e-3 < at_s && at_s < event.off_s - 0.3;
            assert!(!inside || with.contact, "{shape}: {at_s} {event:?}");
            assert!(at_s < event.off_s + 1e-3 || !with.contact || events.len() > 1);
        }
        assert!(before > 500, "{before}");
    }
}

#[test]
fn labels_name_the_joints_that_bear_a_collision() {
    let (_, events, _) = run(&obstacle(
        "plane: {point_m: [0, 0, 0.35], normal: [0, 0, 1]}",
        SOFT,
    ));
    let joints = &events[0].joints;
    let names: Vec<&str> = joints.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(
        names,
        [
            "joint1", "joint2", "joint3", "joint4", "joint5", "joint6", "joint7"
        ]
    );
    // Upwards at x = 0.42 m: about the y axis of joint 2, that is minus force times lever.
    let expected = -events[0].force_n[2] * events[0].point_m[0];
    assert!(
        (joints[1].1 / expected - 1.0).abs() < 0.02,
        "{joints:?} {expected}"
    );
    assert!(joints[0].1.abs() < 0.02 * expected.abs(), "{joints:?}");
}

#[test]
fn a_round_tip_touches_earlier_and_obstacles_come_and_go() {
    let plane = "plane: {point_m: [0, 0, 0.35], normal: [0, 0, 1]}";
    let point = &run(&obstacle(plane, SOFT)).1[0];
    let round = &run(&obstacle(&format!("{plane}, radius_m: 0.04"), SOFT)).1[0];
    assert!(round.on_s < point.on_s - 0.02, "{round:?} {point:?}");
    let gone = run(&obstacle(&format!("{plane}, to_s: 0.4"), SOFT)).1;
    assert_eq!(gone, []);
}

#[test]
fn a_person_pushes_on_top_of_a_collision() {
    let scenario = ideal(
        &format!(
            "duration_s: 5, {DOWN}, obstacles: [{{plane: {{point_m: [0, 0, 0.35], normal: [0, 0, 1]}}, \
             label: {{material: foam, zone: NR}}}}], contacts: [{{link: link6, force_n: [0, 20, 0], \
             t_on_s: 2.2, t_off_s: 2.8, profile: half_sine, kind: cooperation, label: {{operator: op1}}}}]"
        ),
        SOFT,
    );
    let folder = tempfile::tempdir().unwrap();
    let nothing = std::collections::BTreeMap::default();
    let made = simulate(&scenario, &arm(), folder.path(), &nothing, &mut |_| true);
    let text = std::fs::read_to_string(made.unwrap().unwrap().labels_path).unwrap();
    let labels: serde_json::Value = serde_json::from_str(&text).unwrap();
    let events = labels["recordings"]["a"]["events"].as_array().unwrap();
    let kinds: Vec<_> = events.iter().map(|e| e["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["collision", "cooperation"], "{events:#?}");
    let [hit, led] = [&events[0], &events[1]];
    assert_eq!(
        (&hit["material"], &hit["zone"]),
        (&"foam".into(), &"NR".into())
    );
    assert_eq!(
        (&led["during"], &led["operator"]),
        (&"collision".into(), &"op1".into())
    );
    assert!(hit.get("during").is_none() && hit.get("operator").is_none());
    assert_eq!(led["joints"].as_array().unwrap().len(), 6);
    assert_eq!(
        led["joints"].as_array().unwrap().len(),
        led["joint_torques"].as_array().unwrap().len()
    );
}

#[test]
fn forces_of_a_hand_rise_as_their_profile_says() {
    // The effort of a stiff joint that the push works against shows the force.
    let share = |profile: &str, ms: usize| -> f64 {
        let scenario = ideal(
            &format!(
                "duration_s: 2, motion: {{points: {{through: [[0, 1.5, 0, 0, 0, 0, 0]]}}}}, contacts: \
                 [{{link: link3, force_n: [0, 10, 0], t_on_s: 0.5, t_off_s: 1.5, rise_s: 0.4, profile: {profile}}}]"
            ),
            "controller: {natural_hz: 50, damping: 2},",
        );
        let readings = readings(&scenario);
        let effort = |ms: usize| readings[ms].effort[0] - readings[490].effort[0];
        effort(ms) / effort(1000)
    };
    for (profile, expected) in [
        ("smooth", [0.146, 0.5, 1.0]),
        ("trapezoid", [0.25, 0.5, 1.0]),
        ("half_sine", [0.309, 0.588, 0.951]),
    ] {
        for (ms, expected) in [600, 700, 900].into_iter().zip(expected) {
            let share = share(profile, ms);
            assert!(
                (share - expected).abs() < 0.04,
                "{profile} {ms} ms: {share} {expected}"
            );
        }
    }
}

#[test]
fn an_obstacle_that_cannot_be_is_refused_with_what_to_do() {
    for (shape, words) in [
        (
            "stiffness_n_per_m: 100",
            "exactly one of `plane`, `box` and `sphere`",
        ),
        (
            "plane: {point_m: [0, 0, 0], normal: [0, 0, 0]}",
            "`plane.normal`",
        ),
        (
            "box: {center_m: [0, 0, 0], size_m: [1, 0, 1]}",
            "`box.size_m`",
        ),
        (
            "sphere: {center_m: [0, 0, 0], radius_m: 0}",
            "`sphere.radius_m`",
        ),
        (
            "plane: {point_m: [0, 0, 0.6], normal: [0, 0, 1]}",
            "inside of it",
        ),
        (
            "plane: {point_m: [0, 0, 0], normal: [0, 0, 1]}, from_s: 2, to_s: 1",
            "`from_s`",
        ),
        (
            "plane: {point_m: [0, 0, 0], normal: [0, 0, 1]}, link: hand",
            "`hand`",
        ),
    ] {
        let error = Simulation::new(&obstacle(shape, ""), &arm(), 0)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("obstacle") && error.contains(words),
            "{shape}: {error}"
        );
    }
}
