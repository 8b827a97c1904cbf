use std::path::{Path, PathBuf};

use tauscope_bus::MAX_JOINTS;
use tauscope_dynamics::terms::TermSpec;
use tauscope_dynamics::{Data, Model, forward_kinematics, gravity_effort, link_pose, rnea};

use super::plant::{Drive, Plant};
use super::*;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data");
/// Joints of the demo arm.
const N: usize = 7;

fn arm() -> Model {
    let urdf = std::fs::read_to_string(Path::new(DATA).join("demo_arm.urdf")).unwrap();
    Model::from_urdf(&urdf).unwrap()
}

fn scenario(yaml: &str) -> Scenario {
    serde_saphyr::from_str(yaml).unwrap()
}

/// An ideal arm measured at 1 kHz, and what the text adds.
fn ideal(recording: &str, more: &str) -> Scenario {
    scenario(&format!(
        "{{version: 1, robot: demo_arm.urdf, seed: 3, rate_hz: 1000, {more} \
          recordings: [{{name: a, {recording}}}]}}"
    ))
}

fn friction() -> String {
    let joints = (1..=N).map(|j| {
        format!(
            "{{effect: coulomb_friction, joint: joint{j}, parameters: {{coulomb_nm: {}}}}}, \
             {{effect: viscous_friction, joint: joint{j}, parameters: {{viscous_nms_per_rad: {}}}}}",
            COULOMB_NM[j - 1],
            VISCOUS[j - 1]
        )
    });
    format!("physics: [{}],", joints.collect::<Vec<_>>().join(", "))
}

const COULOMB_NM: [f64; N] = [4.0, 3.5, 2.0, 2.0, 1.0, 0.8, 0.5];
const VISCOUS: [f64; N] = [5.0, 5.0, 3.0, 2.0, 1.0, 1.0, 0.3];

fn readings(scenario: &Scenario) -> Vec<Reading> {
    let mut simulation = Simulation::new(scenario, &arm(), 0).unwrap();
    std::iter::from_fn(|| simulation.next_reading().unwrap()).collect()
}

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
    // What is held is worth the name.
    let first = readings(&scenario)[0];
    assert!(first.effort[1] < -10.0, "{:?}", first.effort);
}

/// Largest difference of what was measured from RNEA + friction - torque of the push, by joint, over
/// all instants; the acceleration is that of the next millisecond.
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
            // Where the sign of friction changes within the millisecond, its mean is not known.
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

/// Drives that only give an effort.
fn constant(effort_nm: &[f64; N]) -> Drive<'_> {
    Drive {
        effort_nm,
        damping: &[0.0; N],
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
        joint: format!("joint{joint}"),
        parameters: [("coulomb_nm".to_owned(), 30.0)].into(),
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
        // What holds gravity on a smoothed sign must creep a little.
        assert!(velocity.abs() < 4e-3, "joint {j}: {velocity}");
    }
}

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

/// Files of a folder by name.
fn bytes(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| {
            (
                path.file_name().unwrap().into(),
                std::fs::read(&path).unwrap(),
            )
        })
        .collect();
    files.sort();
    files
}

fn make(seed: u64, folder: &Path) -> Simulated {
    let scenario = scenario(&format!(
        "{{version: 1, name: twice, robot: demo_arm.urdf, seed: {seed}, {} \
          sensors: {{effort_noise_nm: 0.1}}, recordings: [\
          {{name: a, duration_s: 2, motion: {{points: {{}}}}}}, \
          {{name: b, role: test, duration_s: 8, motion: {{fourier: {{}}}}, hands: {{count: 2}}}}]}}",
        friction()
    ));
    simulate(
        &scenario,
        &arm(),
        folder,
        &std::collections::BTreeMap::default(),
        &mut |_| true,
    )
    .unwrap()
    .unwrap()
}

#[test]
fn the_same_seed_makes_the_same_bytes() {
    let folders = [(); 3].map(|()| tempfile::tempdir().unwrap());
    for (folder, seed) in folders.iter().zip([1, 1, 2]) {
        make(seed, folder.path());
    }
    let [first, again, other] = [0, 1, 2].map(|i| bytes(folders[i].path()));
    assert_eq!(first.len(), 3);
    assert!(first == again);
    assert!(
        first
            .iter()
            .zip(&other)
            .all(|(a, b)| a.0 == b.0 && a.1 != b.1)
    );
}

#[test]
fn labels_say_what_was_done() {
    let folder = tempfile::tempdir().unwrap();
    let made = make(1, folder.path());
    let text = std::fs::read_to_string(made.labels_path).unwrap();
    let labels: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(labels["set"], "twice");
    let b = &labels["recordings"]["b"];
    assert_eq!(b["role"], "test");
    let events = b["events"].as_array().unwrap();
    assert_eq!(events.len(), 2);
    for event in events {
        let force = (0..3)
            .map(|k| event["force"][k].as_f64().unwrap().powi(2))
            .sum::<f64>()
            .sqrt();
        assert!((10.0..30.0).contains(&force), "{event}");
        assert!((force - event["peak_force"].as_f64().unwrap()).abs() < 1e-3);
        let [on, off] = ["t_on", "t_off"].map(|key| event[key].as_f64().unwrap());
        assert!(2.0 <= on && on + 0.39 < off && off <= 8.0, "{event}");
        assert!(event["link"].as_str().unwrap().starts_with("link"));
        assert!(event["point"][2].as_f64().unwrap() > 0.0);
    }
    assert_eq!(
        labels["recordings"]["a"]["events"]
            .as_array()
            .unwrap()
            .len(),
        0
    );
}

#[test]
fn work_that_is_broken_off_leaves_nothing_that_looks_whole() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = ideal("duration_s: 1, motion: {fourier: {}}", "");
    let nothing = std::collections::BTreeMap::default();
    let made = simulate(&scenario, &arm(), folder.path(), &nothing, &mut |done| {
        done < 0.5
    });
    assert!(made.unwrap().is_none());
    let left: Vec<_> = bytes(folder.path())
        .into_iter()
        .map(|(name, _)| name)
        .collect();
    assert_eq!(left, [PathBuf::from("a.mcap.part")]);
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
