//! The arm moves according to the equation of motion.

use tauscope_bus::MAX_JOINTS;
use tauscope_dynamics::terms::TermSpec;
use tauscope_dynamics::{Data, forward_kinematics, gravity_effort, link_pose, rnea};

use super::super::plant::{Damping, Drive, Plant};
use super::*;

#[test]
fn at_rest_the_motors_hold_gravity_within_friction() {
    let scenario = ideal(
        "duration_s: 3, motion: {points: {through: [[0.1, 0.6, 0.2, 1.1, -0.4, 0.7, 0]]}}",
        &friction(),
    );
    let (model, mut data) = (arm(), Data::new(&arm()));
    for reading in readings(&scenario) {
        let gravity = gravity_effort(&model, &mut data, &reading.position[..N]);
        for j in 0..N {
            let rest = reading.effort[j] - gravity[j];
            assert!(rest.abs() < COULOMB_NM[j], "joint {j}: {rest}");
            assert!(reading.velocity[j].abs() < 1e-3, "joint {j}: {reading:?}");
        }
    }
    // The gravity effort is large enough for a meaningful test.
    let first = readings(&scenario)[0];
    assert!(first.effort[1] < -10.0, "{:?}", first.effort);
}

/// Returns the largest difference of the measured effort from RNEA + friction - torque of the push, by joint,
/// over all instants; the acceleration is that of the next millisecond.
fn worst(readings: &[Reading], mut push: impl FnMut(&Reading) -> [f64; MAX_JOINTS]) -> [f64; N] {
    let (model, mut data) = (arm(), Data::new(&arm()));
    let mut worst = [0.0_f64; N];
    for pair in readings.windows(2) {
        let [now, next] = [&pair[0], &pair[1]];
        let middle = |a: [f64; MAX_JOINTS], b: [f64; MAX_JOINTS]| -> [f64; N] {
            std::array::from_fn(|j| 0.5 * (a[j] + b[j]))
        };
        let position = middle(now.position, next.position);
        let velocity = middle(now.velocity, next.velocity);
        let acceleration: [f64; N] =
            std::array::from_fn(|j| (next.velocity[j] - now.velocity[j]) * 1e3);
        let rigid = rnea(&model, &mut data, &position, &velocity, &acceleration);
        let pushed = push(now);
        let effort = middle(now.effort, next.effort);
        for j in 0..N {
            // The mean friction is unknown if its sign changes within the millisecond.
            if velocity[j].abs() < 0.01 {
                continue;
            }
            let friction = COULOMB_NM[j] * velocity[j].signum() + VISCOUS[j] * velocity[j];
            let error = effort[j] - (rigid[j] + friction - pushed[j]);
            worst[j] = worst[j].max(error.abs());
        }
    }
    worst
}

#[test]
fn moving_effort_is_rigid_body_and_friction() {
    let scenario = ideal(
        "duration_s: 6, motion: {fourier: {period_s: 3}}",
        &friction(),
    );
    let readings = readings(&scenario);
    let fastest = (0..N).map(|j| {
        readings
            .iter()
            .fold(0.0_f64, |v, r| v.max(r.velocity[j].abs()))
    });
    let fastest: Vec<_> = fastest.collect();
    assert!(fastest.iter().all(|v| *v > 0.1), "{fastest:?}");
    let worst = worst(&readings, |_| [0.0; MAX_JOINTS]);
    for (j, error) in worst.into_iter().enumerate() {
        assert!(error < 0.03 * COULOMB_NM[j] + 0.02, "joint {j}: {error}");
    }
}

/// `Jᵀ F` of a force at a point of a link, with the Jacobian by differences of the point's place.
fn push_torque(
    model: &Model,
    data: &mut Data,
    position: [f64; MAX_JOINTS],
    (link, point, force): (usize, [f64; 3], [f64; 3]),
) -> [f64; MAX_JOINTS] {
    let mut work = |j: usize, step: f64| -> f64 {
        let mut position = position;
        position[j] += step;
        forward_kinematics(model, data, &position[..N]);
        let place = link_pose(model, data, link) * nalgebra::Point3::from(point);
        (0..3).map(|k| place[k] * force[k]).sum()
    };
    std::array::from_fn(|j| {
        if j < N {
            (work(j, 1e-6) - work(j, -1e-6)) / 2e-6
        } else {
            0.0
        }
    })
}

#[test]
fn a_push_shows_as_minus_the_external_torque() {
    let force = [15.0, -12.0, 9.0];
    let point = [0.01, 0.02, 0.08];
    let scenario = ideal(
        "duration_s: 6, motion: {fourier: {period_s: 3}}, contacts: [{link: link6, \
         point_m: [0.01, 0.02, 0.08], force_n: [15, -12, 9], t_on_s: 2, t_off_s: 4, rise_s: 0.1}]",
        &friction(),
    );
    let held: Vec<_> = readings(&scenario)
        .into_iter()
        .enumerate()
        .filter(|(ms, reading)| {
            assert_eq!(reading.contact, (2001..=3999).contains(ms), "{ms} ms");
            (2101..3899).contains(ms)
        })
        .map(|(_, reading)| reading)
        .collect();
    let (model, mut data) = (arm(), Data::new(&arm()));
    let push = (model.link_index("link6").unwrap(), point, force);
    let mut torque = |reading: &Reading| push_torque(&model, &mut data, reading.position, push);
    assert!(held.iter().any(|reading| torque(reading)[1].abs() > 5.0));
    for (j, error) in worst(&held, torque).into_iter().enumerate() {
        assert!(error < 0.03 * COULOMB_NM[j] + 0.02, "joint {j}: {error}");
    }
}

/// Returns a command of a constant effort without damping.
fn constant(effort_nm: &[f64; N]) -> Drive<'_> {
    Drive {
        effort_nm,
        damping: Damping::Joints(&[0.0; N]),
        velocity: &[0.0; N],
        limit_nm: &[f64::INFINITY; N],
    }
}

#[test]
fn an_arm_that_nobody_drives_keeps_its_energy() {
    let (model, mut data) = (arm(), Data::new(&arm()));
    let start = [0.3, 0.9, -0.4, 1.2, 0.2, 0.6, 0.1];
    let mut plant = Plant::new(&model, &[], &start).unwrap();
    let mut energy = |plant: &Plant| -> f64 {
        let (q, v) = (plant.position().to_vec(), plant.velocity().to_vec());
        let inertia = tauscope_dynamics::mass_matrix(&model, &mut data, &q).clone();
        let v = nalgebra::DVector::from_vec(v);
        let kinetic = 0.5 * (v.transpose() * inertia * &v)[(0, 0)];
        forward_kinematics(&model, &mut data, &q);
        let potential: f64 = (0..model.links().len())
            .map(|link| {
                let inertia = &model.links()[link].inertia;
                let com = nalgebra::Point3::from(inertia.com_m());
                9.81 * inertia.mass_kg() * (link_pose(&model, &data, link) * com).z
            })
            .sum();
        kinetic + potential
    };
    let before = energy(&plant);
    let mut fastest = 0.0_f64;
    for _ in 0..2000 {
        plant.step(2.5e-4, &constant(&[0.0; N]), std::iter::empty());
        fastest = fastest.max(plant.velocity()[1].abs());
    }
    assert!(fastest > 2.0, "it falls: {fastest}");
    let drift = energy(&plant) - before;
    assert!(
        drift.abs() < 0.2,
        "{drift} J of some 20 J that went to and fro"
    );
}

#[test]
fn friction_far_stiffer_than_the_step_neither_chatters_nor_swings_back() {
    // 30 N m over 2 mrad/s on a last joint of 0.001 kg m²: a time constant of 0.07 us.
    let spec = |joint: usize| TermSpec {
        effect: "coulomb_friction".to_owned(),
        joint: Some(format!("joint{joint}")),
        parameters: [("coulomb_nm".to_owned(), 30.0)].into(),
        ..TermSpec::default()
    };
    let physics: Vec<_> = (1..=N).map(spec).collect();
    let start = [0.0, 0.5, 0.0, 1.0, 0.0, 0.5, 0.0];
    let mut plant = Plant::new(&arm(), &physics, &start).unwrap();
    let mut effort = [0.0; N];
    effort[6] = 40.0;
    for _ in 0..400 {
        plant.step(2.5e-4, &constant(&effort), std::iter::empty());
    }
    assert!(plant.velocity()[6] > 1.0, "{:?}", plant.velocity());
    for i in 0..4000 {
        let before = plant.velocity()[6];
        plant.step(2.5e-4, &constant(&[0.0; N]), std::iter::empty());
        let now = plant.velocity()[6];
        assert!(
            now <= before.max(2e-3) && now > -2e-3,
            "step {i}: {before} {now}"
        );
    }
    for (j, velocity) in plant.velocity().iter().enumerate() {
        // Friction with a smoothed sign holds gravity only with a slow creep.
        assert!(velocity.abs() < 4e-3, "joint {j}: {velocity}");
    }
}
