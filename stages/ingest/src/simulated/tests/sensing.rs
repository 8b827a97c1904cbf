//! Published values of the arm, and refused scenarios.

use super::*;

#[test]
fn a_tool_weighs_on_the_joints_and_the_controller_knows() {
    let motion = "duration_s: 1, motion: {points: {through: [[0, 1.2, 0, 0.5, 0, 0, 0]]}}";
    let bare = readings(&ideal(motion, ""));
    let tool = "tool: {link: tool, mass_kg: 1.5, com_m: [0, 0, 0.05]},";
    let heavy = readings(&ideal(motion, tool));
    let more = bare[500].effort[1] - heavy[500].effort[1];
    // 1.5 kg at a reach of about 0.9 m.
    assert!((10.0..15.0).contains(&more), "{more}");
    assert!((heavy[500].position[1] - 1.2).abs() < 1e-6);
}

#[test]
fn sensors_scale_shift_and_round() {
    let motion = "duration_s: 1, motion: {points: {through: [[0, 1.2, 0, 0.5, 0, 0, 0]]}}";
    let exact = readings(&ideal(motion, ""))[500];
    let sensors = "effort_unit: A, torque_constants_nm_per_a: {joint1: 10, joint2: 10, joint3: 8, \
                   joint4: 8, joint5: 5, joint6: 5, joint7: 2}, \
                   sensors: {effort_gain: {joint2: 1.1}, effort_bias_nm: {joint4: 2}, \
                             position_step_rad: 0.25},";
    let measured = readings(&ideal(motion, sensors))[500];
    assert!((measured.effort[1] - 0.11 * exact.effort[1]).abs() < 1e-9);
    assert!((measured.effort[3] - (exact.effort[3] + 2.0) / 8.0).abs() < 1e-9);
    assert!((measured.position[1] - 1.25).abs() < 1e-12);
    assert!((measured.command_position[1] - 1.25).abs() < 1e-12);
}

#[test]
fn noise_is_as_large_as_it_is_said_to_be() {
    let motion = "duration_s: 2, motion: {points: {through: [[0, 1.2, 0, 0.5, 0, 0, 0]]}}";
    let sensors = "sensors: {effort_noise_nm: 0.3, effort_noise_of_limit: 0.01, \
                   velocity_noise_rad_s: 0.02},";
    let readings = readings(&ideal(motion, sensors));
    let deviation = |of: fn(&Reading) -> f64| {
        let mean = readings.iter().map(of).sum::<f64>() / readings.len() as f64;
        let square = |reading| (of(reading) - mean) * (of(reading) - mean);
        (readings.iter().map(square).sum::<f64>() / readings.len() as f64).sqrt()
    };
    // Joint 1's limit is 90 N m.
    let effort = deviation(|reading| reading.effort[0]);
    assert!((effort - 0.3_f64.hypot(0.9)).abs() < 0.05, "{effort}");
    let velocity = deviation(|reading| reading.velocity[0]);
    assert!((velocity - 0.02).abs() < 0.001, "{velocity}");
}

#[test]
fn stamps_follow_the_rate_and_the_session() {
    let scenario = scenario(
        "{version: 1, robot: demo_arm.urdf, rate_hz: 125, start_s: 1000, recordings: [\
          {name: a, duration_s: 0.1, motion: {fourier: {}}}, \
          {name: b, duration_s: 0.1, motion: {fourier: {}}}]}",
    );
    let mut simulation = Simulation::new(&scenario, &arm(), 1).unwrap();
    let stamps: Vec<_> = std::iter::from_fn(|| simulation.next_reading().unwrap())
        .map(|reading| reading.stamp_ns)
        .collect();
    assert_eq!(stamps[0], 1_010_100_000_000);
    assert!(
        stamps.windows(2).all(|pair| pair[1] - pair[0] == 8_000_000),
        "{stamps:?}"
    );
    assert_eq!(stamps.len(), 13);
}

#[test]
fn what_does_not_fit_the_robot_is_told() {
    let motion = "duration_s: 1, motion: {fourier: {}}";
    let contact = |text: &str| format!("{motion}, contacts: [{{force_n: [1, 0, 0], {text}}}]");
    for (recording, more, expected) in [
        (
            "duration_s: 1, motion: {}",
            "",
            "exactly one of `points`, `fourier` and `recorded`, found 0",
        ),
        (
            &contact("link: hand, t_on_s: 0, t_off_s: 1"),
            "",
            "link `hand`, which the robot does not have; its links: base",
        ),
        (
            &contact("link: link3, t_on_s: 0.5, t_off_s: 2"),
            "",
            "is no time within the 1 s",
        ),
        (
            motion,
            "physics: [{effect: magic, joint: joint1, parameters: {}}],",
            "magic",
        ),
        (
            motion,
            "sensors: {effort_gain: {wrist: 2}},",
            "names joint `wrist`",
        ),
        (motion, "effort_unit: A,", "joint `joint1`"),
        (
            motion,
            "tool: {link: hand, mass_kg: 1},",
            "the tool is on link `hand`",
        ),
        (
            "duration_s: 1, motion: {points: {through: [[1, 2]]}}",
            "",
            "has 2 values, the robot has 7 joints",
        ),
        (
            "duration_s: 1, motion: {points: {through: [[0, 0, 0, 0, 0, 0, 9]]}}",
            "",
            "9 is outside of joint `joint7`'s limits -2.9 to 2.9",
        ),
        (
            "duration_s: 1, motion: {points: {min_height_m: 3}}",
            "",
            "3 m above the base",
        ),
        (
            "duration_s: 1, motion: {fourier: {}}, hands: {count: 5}",
            "",
            "5 pushes of up to 1.2 s do not fit",
        ),
    ] {
        let error = Simulation::new(&ideal(recording, more), &arm(), 0)
            .unwrap_err()
            .to_string();
        assert!(error.contains(expected), "{error}");
    }
}
