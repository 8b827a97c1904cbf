//! Every layer of physics: the recorded effort is that of RNEA and the terms on the recorded motion.

use tauscope_dynamics::terms::{
    EFFECTS, Effect, MotionSample, Physics, PlaceKind, Simulated, TermSpec,
};
use tauscope_dynamics::{Data, rnea};

use super::conceal::concealing;
use super::*;

const MOTION: &str = "duration_s: 6, motion: {fourier: {period_s: 3}}";

/// Returns two root mean squares over joints and instants: of the effort of the scenario's terms, and of the error of
/// RNEA and the terms against the record. Both get the mean position and velocity of two readings, and the
/// acceleration between them.
fn suffered(scenario: &Scenario) -> (f64, f64) {
    let specs: Vec<TermSpec> = scenario.physics.clone();
    let (model, mut data) = (arm(), Data::new(&arm()));
    let mut physics = Physics::build(&specs, &model).unwrap();
    let readings = readings(scenario);
    let (mut changed, mut wrong, mut count) = (0.0, 0.0, 0.0);
    for (k, pair) in readings.windows(2).enumerate() {
        let [now, next] = [&pair[0], &pair[1]];
        let middle =
            |a: &[f64], b: &[f64]| -> [f64; N] { std::array::from_fn(|j| 0.5 * (a[j] + b[j])) };
        let position = middle(&now.position, &next.position);
        let velocity = middle(&now.velocity, &next.velocity);
        let acceleration: [f64; N] =
            std::array::from_fn(|j| (next.velocity[j] - now.velocity[j]) * 1e3);
        let rigid = rnea(&model, &mut data, &position, &velocity, &acceleration).to_vec();
        let time_s = (k as f64 + 0.5) * 1e-3;
        let at = MotionSample {
            dt_s: if k == 0 { 0.0 } else { 1e-3 },
            recording_s: time_s,
            session_s: time_s,
            position: &position,
            velocity: &velocity,
            acceleration: &acceleration,
            transmitted: &rigid,
        };
        let mut expected = rigid.clone();
        physics.act(&at, &mut expected);
        let effort = middle(&now.effort, &next.effort);
        // Skip the transient of the drives at the start of the recording.
        if k < 1000 {
            continue;
        }
        for j in 0..N {
            changed += (expected[j] - rigid[j]).powi(2);
            wrong += (effort[j] - expected[j]).powi(2);
            count += 1.0;
        }
    }
    ((changed / count).sqrt(), (wrong / count).sqrt())
}

/// Error of finite differences between readings at 1 kHz, without any physics \[N m\].
const DISCRETE_NM: f64 = 0.015;

/// Checks that the term changes the effort, and explains all but a fraction `share` of the change.
fn agrees(physics: &str, share: f64) {
    let (changed, wrong) = suffered(&ideal(MOTION, &format!("physics: [{physics}],")));
    assert!(changed > 0.05, "{physics} is not felt: {changed}");
    assert!(
        wrong < share * changed + DISCRETE_NM,
        "{physics}: {wrong} of {changed}"
    );
}

const PAYLOAD: &str = "mass_kg: 1.2, com_x_m: 0.02, com_y_m: -0.03, com_z_m: 0.08, ixx_kgm2: 0.002, \
                       iyy_kgm2: 0.003, izz_kgm2: 0.001";

/// Largest fraction of its effort change that a drawn effect's term may leave unexplained, for a joint split in two.
const SHARE_SPLIT: f64 = 0.6;
/// Largest such fraction for all other effects.
const SHARE: f64 = 0.1;

/// Number of scenarios drawn for each effect.
const DRAWS: usize = 4;

/// Returns a scenario with an effect that is drawn like a concealed one.
fn drawn(effect: &Effect, seed: usize) -> Scenario {
    let concealing = concealing(&format!("seed: {seed}, effects: [{}]", effect.name));
    let (open, _) = super::super::conceal::add(&concealing, &arm()).unwrap();
    Scenario {
        physics: open.into_owned().physics,
        ..ideal(MOTION, "")
    }
}

/// Returns a scenario with an effect that is never drawn.
fn describing(effect: &Effect) -> Scenario {
    let physics = match effect.place {
        PlaceKind::Link => {
            "{effect: link_inertia, link: link4, parameters: {delta_mass_kg: 0.3, delta_first_moment_x_kgm: 0.02, \
              delta_first_moment_y_kgm: 0, delta_first_moment_z_kgm: 0.01, delta_origin_ixx_kgm2: 0.002, \
              delta_origin_ixy_kgm2: 0, delta_origin_ixz_kgm2: 0, delta_origin_iyy_kgm2: 0.002, \
              delta_origin_iyz_kgm2: 0, delta_origin_izz_kgm2: 0.002}}"
        }
        _ => {
            "{effect: unknown, joint: joint3, table: {against: position, knots: [-1, 0, 1], values: [2, -1, 2]}}"
        }
    };
    ideal(MOTION, &format!("physics: [{physics}],"))
}

#[test]
fn every_effect_is_suffered_as_its_term_says_or_says_why_it_cannot_be() {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for first in 0..threads {
            let own = EFFECTS.iter().skip(first).step_by(threads);
            scope.spawn(|| own.for_each(|effect| suffers(effect)));
        }
    });
}

fn suffers(effect: &'static Effect) {
    if let Simulated::No(reason) = effect.simulated {
        assert!(!reason.is_empty(), "{}", effect.name);
        return;
    }
    // Not every draw changes the effort in this motion: a limit may not be reached. The draws are pooled, since a
    // joint whose two sides chatter is explained less well than others.
    let draws: Vec<(f64, f64)> = if effect.concealed.is_some() {
        (0..DRAWS)
            .map(|seed| suffered(&drawn(effect, seed)))
            .collect()
    } else {
        vec![suffered(&describing(effect))]
    };
    let pooled = |of: fn(&(f64, f64)) -> f64| {
        (draws.iter().map(|draw| of(draw).powi(2)).sum::<f64>() / draws.len() as f64).sqrt()
    };
    let (changed, wrong) = (pooled(|draw| draw.0), pooled(|draw| draw.1));
    assert!(changed > 0.0, "{} is not felt", effect.name);
    let share = if effect.splits_joint() {
        SHARE_SPLIT
    } else {
        SHARE
    };
    assert!(
        wrong < share * changed + DISCRETE_NM,
        "{}: {wrong} of {changed}, by draw {draws:?}",
        effect.name
    );
}

#[test]
fn bodies_that_last() {
    agrees(
        &format!("{{effect: payload, parameters: {{{PAYLOAD}}}}}"),
        0.02,
    );
    agrees(
        "{effect: link_mass, link: link3, parameters: {delta_mass_kg: 0.8}}",
        0.02,
    );
    agrees(
        "{effect: link_com, link: link4, parameters: {delta_com_x_m: 0.03, delta_com_y_m: 0.02, \
          delta_com_z_m: -0.04}}",
        0.02,
    );
    agrees(
        "{effect: base_tilt, parameters: {roll_rad: 0.1, pitch_rad: -0.05}}",
        0.02,
    );
}

#[test]
fn bodies_that_come_and_go() {
    agrees(
        &format!(
            "{{effect: payload_pickup, parameters: {{{PAYLOAD}, t_start_s: 2.0, t_end_s: 4.2}}}}"
        ),
        0.05,
    );
}

#[test]
fn forces_from_outside() {
    agrees(
        "{effect: external_push, link: link5, parameters: {force_x_n: 12, force_y_n: -8, force_z_n: 5, \
          t_start_s: 2.5, t_end_s: 4}}",
        0.05,
    );
    agrees(
        "{effect: contact_wall, parameters: {stiffness_n_per_m: 1500, normal_x: 0, normal_y: 1, \
          normal_z: 0, offset_m: 0.0}}",
        0.05,
    );
}

#[test]
fn transmissions_that_give_way() {
    agrees(
        "{effect: joint_elasticity, joint: joint2, parameters: {stiffness_nm_per_rad: 900, \
          rotor_inertia_kgm2: 0.15}}",
        0.1,
    );
    agrees(
        "{effect: backlash, joint: joint4, parameters: {gap_rad: 0.01, rotor_inertia_kgm2: 0.05}}",
        0.5,
    );
}

#[test]
fn the_record() {
    agrees(
        "{effect: torque_gain, joint: joint2, parameters: {gain: 1.2}}",
        0.02,
    );
    agrees(
        "{effect: torque_bias, joint: joint4, parameters: {bias_nm: -1.5}}",
        0.02,
    );
    agrees("{effect: torque_delay, parameters: {delay_s: 0.02}}", 0.02);
    agrees("{effect: torque_lowpass, parameters: {cutoff_hz: 4}}", 0.02);
    agrees(
        "{effect: torque_saturation, joint: joint2, parameters: {limit_nm: 10}}",
        0.02,
    );
    agrees(
        "{effect: transmission_coupling, joint: joint6, source_joint: joint4, parameters: \
          {coefficient: 0.2}}",
        0.02,
    );
}

#[test]
fn all_layers_together() {
    agrees(
        &format!(
            "{{effect: torque_gain, joint: joint2, parameters: {{gain: 1.1}}}}, \
             {{effect: viscous_friction, joint: joint2, parameters: {{viscous_nms_per_rad: 4}}}}, \
             {{effect: rotor_inertia, joint: joint3, parameters: {{inertia_kgm2: 0.4}}}}, \
             {{effect: torque_delay, parameters: {{delay_s: 0.01}}}}, \
             {{effect: payload, parameters: {{{PAYLOAD}}}}}"
        ),
        0.02,
    );
}

#[test]
fn a_joint_has_one_transmission() {
    let two = ideal(
        "duration_s: 1, motion: {fourier: {}}",
        "physics: [{effect: joint_elasticity, joint: joint2, parameters: {stiffness_nm_per_rad: 900, \
          rotor_inertia_kgm2: 0.1}}, {effect: backlash, joint: joint2, parameters: {gap_rad: 0.01, \
          rotor_inertia_kgm2: 0.1}}],",
    );
    let error = Simulation::new(&two, &arm(), 0).unwrap_err().to_string();
    assert!(
        error.contains("joint `joint2` has more than one of"),
        "{error}"
    );
}
