//! The twin as a stage, on an arm that can be solved on paper: a point mass on a massless rod.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use tauscope_bus::{Emit, Header, JointState, LinkError, Stage, TwinState, flags};
use tauscope_dynamics::Model;
use tauscope_twin::{
    Config, Correction, Expected, JointCorrection, Motion, Setup, Twin, TwinError, TwinFile,
};

const MASS_KG: f64 = 2.0;
const LENGTH_M: f64 = 0.5;
const GRAVITY_M_S2: f64 = 9.81;

/// Turns about x; at 0 the mass hangs down.
const PENDULUM: &str = r#"<robot name="pendulum">
  <link name="base"/>
  <link name="rod"><inertial>
    <origin xyz="0 0 -0.5"/><mass value="2"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>
  </inertial></link>
  <joint name="hinge" type="continuous">
    <parent link="base"/><child link="rod"/><axis xyz="1 0 0"/>
  </joint>
</robot>"#;

fn setup() -> Setup {
    let model = Model::from_urdf(PENDULUM).unwrap();
    Setup {
        tool_link: model.link_index("rod"),
        model: Some(model),
        joint_names: vec!["hinge".to_owned()],
        torque_constants_nm_per_a: None,
    }
}

fn twin(config: &Config) -> Twin {
    Twin::new(config, setup(), Correction::none(1)).unwrap()
}

/// The pendulum's effort: m l² q̈ + m g l sin q.
fn effort(q: f64, qdd: f64) -> f64 {
    MASS_KG * LENGTH_M * (LENGTH_M * qdd + GRAVITY_M_S2 * q.sin())
}

#[derive(Default)]
struct Out(Vec<TwinState>);

impl Emit<TwinState> for Out {
    fn emit(&mut self, write: &mut dyn FnMut(&mut TwinState)) -> Result<(), LinkError> {
        let mut sample = TwinState::default();
        write(&mut sample);
        self.0.push(sample);
        Ok(())
    }
}

/// A measured sample at `t_s`.
fn sample(t_s: f64, q: f64, qd: f64, effort: f64) -> JointState {
    let mut sample = JointState {
        header: Header {
            stamp_ns: (t_s * 1e9).round() as i64,
            flags: flags::EFFORT_MEASURED | flags::VELOCITY_MEASURED,
            joint_count: 1,
            ..Header::default()
        },
        ..JointState::default()
    };
    sample.position[0] = q;
    sample.velocity[0] = qd;
    sample.effort[0] = effort;
    sample
}

/// A swing of `amplitude` rad at 0.5 Hz, sampled at 100 Hz for 6 s, the effort exact.
fn swing(amplitude: f64) -> impl Iterator<Item = JointState> {
    let w = std::f64::consts::PI;
    (0..600).map(move |i| {
        let t = f64::from(i) * 0.01;
        let (q, qd) = (amplitude * (w * t).sin(), amplitude * w * (w * t).cos());
        let qdd = -amplitude * w * w * (w * t).sin();
        sample(t, q, qd, effort(q, qdd))
    })
}

fn run(twin: &mut Twin, samples: impl Iterator<Item = JointState>) -> Vec<TwinState> {
    let mut out = Out::default();
    for sample in samples {
        twin.accept(&sample, &mut out).unwrap();
    }
    out.0
}

fn ready(states: &[TwinState]) -> impl Iterator<Item = &TwinState> {
    states.iter().filter(|state| state.header.has(flags::READY))
}

#[test]
fn a_swing_costs_what_it_costs_on_paper() {
    let states = run(&mut twin(&Config::default()), swing(0.8));
    assert_eq!(states.len(), 600);
    assert!(ready(&states).count() > 500);
    for state in ready(&states) {
        // The remaining residual comes from the acceleration filter's lag: 19 ms at a period of 2 s.
        assert!(state.residual[0].abs() < 0.3, "{}", state.residual[0]);
    }
}

#[test]
fn it_is_ready_when_its_filters_have_settled_and_not_before() {
    let mut twin = twin(&Config::default());
    let settling_s = twin.settling_time_s();
    for state in run(&mut twin, swing(0.1)) {
        let settled = state.header.stamp_ns as f64 * 1e-9 >= settling_s;
        assert_eq!(state.header.has(flags::READY), settled);
    }
}

#[test]
fn plain_zeros_of_a_loaded_arm_are_no_effort_and_what_comes_after_them_settles_anew() {
    let zeros = 300..400;
    let samples = swing(0.8).enumerate().map(|(i, mut sample)| {
        if zeros.contains(&i) {
            sample.effort[0] = 0.0;
        }
        sample
    });
    let states = run(&mut twin(&Config::default()), samples);
    let has = |state: &TwinState, flag| state.header.has(flag);
    let lacking: Vec<usize> = (0..states.len())
        .filter(|i| !has(&states[*i], flags::EFFORT_MEASURED))
        .collect();
    // An arm that hangs straight down is not loaded: zero is a valid measurement there.
    assert!(lacking.len() > 80, "{lacking:?}");
    assert!(lacking.iter().all(|i| zeros.contains(i)), "{lacking:?}");
    assert!(
        states[zeros.start..]
            .iter()
            .all(|state| { !has(state, flags::READY) || state.residual[0].abs() < 0.3 })
    );
    assert!(has(&states[599], flags::READY));
}

#[test]
fn the_same_low_pass_runs_over_both_efforts() {
    // Measured effort equal to the expected one, however wild: the residual stays zero.
    let mut first = twin(&Config::default());
    let expected = run(&mut first, swing(2.5));
    let measured = swing(2.5).zip(expected).map(|(mut sample, state)| {
        sample.effort = state.expected_effort;
        sample
    });
    for state in run(&mut twin(&Config::default()), measured) {
        assert!(state.residual[0].abs() < 1e-9);
    }
}

#[test]
fn velocities_alone_move_the_twin_as_the_robot_moved() {
    let config = Config {
        motion: Motion::VelocityHistory,
        ..Config::default()
    };
    let states = run(&mut twin(&config), swing(0.8));
    for (state, sample) in states.iter().zip(swing(0.8)) {
        assert!((state.position[0] - sample.position[0]).abs() < 1e-3);
    }
}

#[test]
fn the_commanded_motion_is_followed_where_there_is_one() {
    let config = Config {
        motion: Motion::Commanded,
        ..Config::default()
    };
    assert_eq!(
        ready(&run(&mut twin(&config), swing(0.8))).count(),
        0,
        "no command, no effort"
    );
    // The robot stands still in spite of its command: the expected effort is that of the command.
    let commanded = swing(0.8).map(|mut sample| {
        sample.header.flags |= flags::COMMAND | flags::COMMAND_VELOCITY;
        sample.command_position = sample.position;
        sample.command_velocity = sample.velocity;
        sample.position[0] = 0.0;
        sample.velocity[0] = 0.0;
        sample
    });
    let states = run(&mut twin(&config), commanded);
    assert!(ready(&states).count() > 500);
    for state in ready(&states) {
        assert!(state.residual[0].abs() < 0.3, "{}", state.residual[0]);
    }
}

#[test]
fn somebody_elses_twin_is_corrected_like_our_own() {
    let config = Config {
        expected: Expected::Topic,
        ..Config::default()
    };
    let setup = Setup {
        model: None,
        ..setup()
    };
    let mut correction = Correction::none(1);
    correction.joints[0] = JointCorrection {
        gain: 2.0,
        offset: 0.5,
        ..JointCorrection::default()
    };
    let mut twin = Twin::new(&config, setup, correction).unwrap();
    let samples = swing(0.8).map(|mut sample| {
        sample.header.flags |= flags::REFERENCE;
        sample.reference_effort[0] = (sample.effort[0] - 0.5) / 2.0;
        sample
    });
    let states = run(&mut twin, samples);
    assert!(ready(&states).all(|state| state.residual[0].abs() < 1e-9));
    assert!(ready(&states).count() > 500);
}

#[test]
fn a_joint_has_the_low_pass_that_its_correction_gives() {
    let after_a_step = |own: Option<f64>, config: &Config| {
        let mut correction = Correction::none(1);
        correction.joints[0].effort_cutoff_hz = own;
        let mut twin = Twin::new(config, setup(), correction).unwrap();
        let samples =
            (0..105).map(|i| sample(0.01 * f64::from(i), 0.0, 0.0, f64::from(u8::from(i > 99))));
        run(&mut twin, samples).last().unwrap().residual[0]
    };
    let usual = Config::default();
    let fast = Config {
        effort_cutoff_hz: Some(9.0),
        ..Config::default()
    };
    assert!(after_a_step(Some(9.0), &usual) > 1.2 * after_a_step(None, &usual));
    let difference = after_a_step(Some(9.0), &usual) - after_a_step(None, &fast);
    assert!(difference.abs() < 1e-12);
}

#[test]
fn without_a_model_or_a_topic_there_is_no_twin() {
    let setup = Setup {
        model: None,
        ..setup()
    };
    let error = Twin::new(&Config::default(), setup, Correction::none(1)).unwrap_err();
    assert!(matches!(error, TwinError::NoModel));
}

#[test]
fn a_tool_weighs_while_it_is_attached() {
    let mut twin = twin(&Config::default());
    let level = std::f64::consts::FRAC_PI_2;
    let with_tool = |t_s: f64, mass_kg: f64| {
        let mut sample = sample(t_s, level, 0.0, 0.0);
        if mass_kg > 0.0 {
            sample.header.flags |= flags::TOOL;
            sample.tool_mass_kg = mass_kg;
            sample.tool_com_m = [0.0, 0.0, -1.0];
        }
        sample
    };
    let samples = [(0.0, 0.0), (0.01, 0.7), (0.02, 0.7), (0.03, 0.0)];
    let states = run(
        &mut twin,
        samples.into_iter().map(|(t, mass)| with_tool(t, mass)),
    );
    for (state, (_, mass)) in states.iter().zip(samples) {
        let expected = effort(level, 0.0) + mass * GRAVITY_M_S2;
        assert!(
            (state.expected_effort[0] - expected).abs() < 1e-9,
            "{mass} kg"
        );
    }
}

#[test]
fn a_gap_and_a_clock_that_jumps_back_start_the_filters_anew() {
    for jump_s in [5.0, -1.0] {
        let mut twin = twin(&Config::default());
        run(&mut twin, swing(0.8));
        let after = run(
            &mut twin,
            swing(0.8).map(|mut sample| {
                sample.header.stamp_ns += ((6.0 + jump_s) * 1e9) as i64;
                sample
            }),
        );
        assert!(after[0].header.has(flags::RESET));
        assert!(!after[0].header.has(flags::READY) && !after[5].header.has(flags::READY));
        assert!(
            after[0].acceleration[0].abs() < f64::EPSILON,
            "no leap of the velocity is read"
        );
        assert!(ready(&after).count() > 500);
    }
}

#[test]
fn currents_follow_from_the_torque_constant() {
    let setup = Setup {
        torque_constants_nm_per_a: Some(vec![4.0]),
        ..setup()
    };
    let mut twin = Twin::new(&Config::default(), setup, Correction::none(1)).unwrap();
    let states = run(&mut twin, std::iter::once(sample(0.0, 1.0, 0.0, 0.0)));
    assert!((states[0].expected_effort[0] - effort(1.0, 0.0) / 4.0).abs() < 1e-12);
}

#[test]
fn the_file_corrects_gain_offset_and_friction() {
    let file = r#"{"version": 1, "robot": {"name": "pendulum"}, "effort_unit": "Nm",
        "filters": {"velocity_cutoff_hz": 12.0, "effort_cutoff_hz": 4.0},
        "joints": {"hinge": {"gain": 1.5, "offset": -0.25}},
        "terms": [{"effect": "viscous_friction", "joint": "hinge",
                   "parameters": {"viscous_nms_per_rad": 3.0}}]}"#;
    let file: TwinFile = serde_json::from_str(file).unwrap();
    let joints = ["hinge".to_owned()];
    let correction = file.resolve(&joints, "Nm").unwrap();
    let mut twin = Twin::new(&Config::default(), setup(), correction).unwrap();
    let states = run(&mut twin, std::iter::once(sample(0.0, 1.0, 0.2, 0.0)));
    let expected = 1.5 * effort(1.0, 0.0) + 3.0 * 0.2 - 0.25;
    assert!((states[0].expected_effort[0] - expected).abs() < 1e-12);

    assert!(
        file.resolve(&joints, "A")
            .unwrap_err()
            .to_string()
            .contains("in A")
    );
    let error = file
        .resolve(&["elbow".to_owned()], "Nm")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("`hinge`") && error.contains("elbow"),
        "{error}"
    );
}

/// A correction of gain 1.5 and offset -0.25 with terms.
fn corrected(terms: &str) -> Correction {
    let mut correction = Correction::none(1);
    correction.joints[0].gain = 1.5;
    correction.joints[0].offset = -0.25;
    correction.terms = serde_json::from_str(terms).unwrap();
    correction
}

#[test]
fn terms_act_in_layers_whatever_their_order() {
    let terms = r#"[
        {"effect": "torque_gain", "joint": "hinge", "parameters": {"gain": 1.1}},
        {"effect": "load_dependent_friction", "joint": "hinge", "parameters": {"coefficient": 0.2}},
        {"effect": "link_mass", "link": "rod", "parameters": {"delta_mass_kg": 1.0}}]"#;
    let setup = Setup {
        torque_constants_nm_per_a: Some(vec![4.0]),
        ..setup()
    };
    let mut twin = Twin::new(&Config::default(), setup, corrected(terms)).unwrap();
    let states = run(&mut twin, std::iter::once(sample(0.0, 1.0, 0.5, 0.0)));
    let gear = 1.5 * effort(1.0, 0.0) * (MASS_KG + 1.0) / MASS_KG;
    let expected = 1.1 * (gear + 0.2 * gear) / 4.0 - 0.25;
    assert!((states[0].expected_effort[0] - expected).abs() < 1e-9);
}

#[test]
fn somebody_elses_twin_may_lack_friction_but_not_bodies() {
    let config = Config {
        expected: Expected::Topic,
        ..Config::default()
    };
    let blind = || Setup {
        model: None,
        torque_constants_nm_per_a: Some(vec![4.0]),
        ..setup()
    };
    let viscous = r#"[{"effect": "viscous_friction", "joint": "hinge",
        "parameters": {"viscous_nms_per_rad": 3.0}}]"#;
    let mut twin = Twin::new(&config, blind(), corrected(viscous)).unwrap();
    let mut sample = sample(0.0, 1.0, 0.5, 0.0);
    sample.header.flags |= flags::REFERENCE;
    sample.reference_effort[0] = 7.0;
    let states = run(&mut twin, std::iter::once(sample));
    let expected = 1.5 * 7.0 + 3.0 * 0.5 / 4.0 - 0.25;
    assert!((states[0].expected_effort[0] - expected).abs() < 1e-12);

    let tilt = r#"[{"effect": "base_tilt", "parameters": {"roll_rad": 0.1, "pitch_rad": 0}}]"#;
    let error = Twin::new(&config, blind(), corrected(tilt)).unwrap_err();
    assert!(error.to_string().contains("`base_tilt` needs the robot"));
}

#[test]
fn a_term_that_does_not_fit_the_robot_is_refused() {
    let wrong = r#"[{"effect": "viscous_friction", "joint": "elbow",
        "parameters": {"viscous_nms_per_rad": 3.0}}]"#;
    let error = Twin::new(&Config::default(), setup(), corrected(wrong)).unwrap_err();
    assert!(error.to_string().contains("elbow"), "{error}");
}

/// Checks the expected efforts of a joint that warms up, over two recordings of 6 s whose first samples are `apart_s`
/// seconds apart. With `goes_on` the second one continues the first; otherwise a new recording begins after the gap.
fn warms_up_over(apart_s: i64, goes_on: bool) {
    let terms = r#"[
        {"effect": "friction_step", "joint": "hinge", "parameters":
            {"coulomb_before_nm": 1.0, "coulomb_after_nm": 3.0, "change_time_session_s": 9.995}},
        {"effect": "temperature_viscous", "joint": "hinge", "parameters":
            {"viscous_warm_nms_per_rad": 0.0, "viscous_extra_cold_nms_per_rad": 10.0,
             "time_constant_s": 5.0}}]"#;
    let mut twin = Twin::new(&Config::default(), setup(), corrected(terms)).unwrap();
    let both = swing(0.0)
        .chain(swing(0.0).map(|mut sample| {
            sample.header.stamp_ns += apart_s * 1_000_000_000;
            sample
        }))
        .map(|mut sample| {
            sample.header.stamp_ns += 1_000_000_000_000;
            sample.velocity[0] = 1.0;
            // An arm with friction is loaded, so exact zeros would be treated as no measurement.
            sample.effort[0] = 1.0;
            sample
        });
    let states = run(&mut twin, both);
    for (i, state) in states.iter().enumerate() {
        let within_s = 0.01 * (i % 600) as f64;
        let session_s = within_s + if i < 600 { 0.0 } else { apart_s as f64 };
        let recording_s = if goes_on { session_s } else { within_s };
        let coulomb = if session_s < 9.995 { 1.0 } else { 3.0 };
        // At position 0 gravity has no torque: the rigid-body effort is that of the apparent acceleration.
        let rigid = 1.5 * MASS_KG * LENGTH_M * LENGTH_M * state.acceleration[0];
        let expected = rigid + coulomb + 10.0 * (-recording_s / 5.0).exp() - 0.25;
        assert!((state.expected_effort[0] - expected).abs() < 1e-9, "{i}");
    }
}

#[test]
fn a_gap_of_a_second_makes_no_joint_cold() {
    warms_up_over(7, true);
}

#[test]
fn a_recording_begins_after_a_pause_and_the_session_does_not() {
    warms_up_over(106, false);
}

#[test]
fn a_tool_weighs_on_a_tilted_base_too() {
    let tilt = r#"[{"effect": "base_tilt", "parameters": {"roll_rad": 0.3, "pitch_rad": 0}}]"#;
    let mut twin = Twin::new(&Config::default(), setup(), corrected(tilt)).unwrap();
    let mut with_tool = sample(0.0, 0.0, 0.0, 0.0);
    with_tool.header.flags |= flags::TOOL;
    with_tool.tool_mass_kg = 0.7;
    with_tool.tool_com_m = [0.0, 0.0, -1.0];
    let states = run(&mut twin, std::iter::once(with_tool));
    // Rolled by 0.3 about its own axis, the rod hangs as if it were turned by 0.3.
    let expected = 1.5 * (effort(0.3, 0.0) + 0.7 * GRAVITY_M_S2 * 0.3_f64.sin()) - 0.25;
    assert!((states[0].expected_effort[0] - expected).abs() < 1e-9);
}
