//! Several things at once, in the simulated cell.

use std::path::Path;

use super::common::{Out, bundled, tauscope, write};
use super::{explain, named, pair, report};

const WALL: [(&str, f64); 5] = [
    ("stiffness_n_per_m", 37.2),
    ("normal_x", 0.525),
    ("normal_y", 0.8455),
    ("normal_z", 0.0976),
    ("offset_m", 0.1505),
];
const CARRIED: [(&str, f64); 9] = [
    ("mass_kg", 0.28),
    ("com_x_m", 0.018),
    ("com_y_m", 0.02),
    ("com_z_m", 0.048),
    ("ixx_kgm2", 4.5e-4),
    ("iyy_kgm2", 4.5e-4),
    ("izz_kgm2", 4.5e-4),
    ("t_start_s", 2.5),
    ("t_end_s", 5.0),
];

const HARDLY_SHOWN: [&str; 2] = ["ixx_kgm2", "iyy_kgm2"];

/// Simulates a scenario into a folder.
fn simulate(folder: &Path, text: &str) {
    let scenario = write(&folder.join("scenario.yaml"), text);
    let mut simulate = tauscope();
    simulate
        .arg("simulate")
        .arg(scenario)
        .arg("--out")
        .arg(folder);
    assert_eq!(Out::of(simulate).code, 0);
}

fn scenario() -> String {
    let numbers = |of: &[(&str, f64)]| {
        let all = of.iter().map(|(name, value)| format!("{name}: {value}"));
        all.collect::<Vec<_>>().join(", ")
    };
    format!(
        "version: 1\nname: carried\nrobot: {}\nseed: 44\nrate_hz: 100\nphysics:\n\
         - {{effect: contact_wall, parameters: {{{}}}}}\n\
         - {{effect: payload_pickup, parameters: {{{}}}}}\n\
         sensors: {{position_noise_rad: 0.00001, velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}\n\
         recordings:\n\
         - {{name: r0, duration_s: 8, motion: {{fourier: {{period_s: 8, harmonics: 5, speed: 0.6, acceleration_rad_s2: 5, range: 0.6}}}}}}\n\
         - {{name: r1, duration_s: 8, motion: {{points: {{speed: 0.5, acceleration_rad_s2: 4, rest_s: [0.1, 0.4], range: 0.6, min_height_m: 0.13}}}}}}\n\
         - {{name: r2, duration_s: 8, motion: {{fourier: {{period_s: 4, harmonics: 4, speed: 0.5, acceleration_rad_s2: 5, range: 0.5}}}}}}\n\
         - {{name: r3, duration_s: 8, motion: {{fourier: {{period_s: 8, harmonics: 4, speed: 0.3, acceleration_rad_s2: 3, range: 0.7}}}}}}\n",
        bundled().join("demo_arm.urdf").display(),
        numbers(&WALL),
        numbers(&CARRIED)
    )
}

#[test]
fn a_wall_and_something_carried_for_a_while_are_both_told_within_their_intervals() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    simulate(folder.path(), &scenario());
    let recordings = ["r0.mcap", "r1.mcap", "r2.mcap", "r3.mcap"].map(path);
    let [r0, r1, r2, r3] = recordings.each_ref().map(|path| path.to_str().unwrap());
    let robot = bundled().join("demo_arm.urdf");
    let (robot, out) = (robot.to_str().unwrap(), path("out"));
    let arguments = [
        "--robot",
        robot,
        "--effort-unit",
        "Nm",
        "--fit",
        r0,
        r1,
        r2,
        "--holdout",
        r3,
    ];
    explain(&out, &arguments);
    let report = report(&out);
    let expected = [pair("contact_wall", "tool"), pair("payload_pickup", "tool")];
    assert_eq!(named(&report), expected);
    for finding in report["findings"].as_array().unwrap() {
        let truth = match finding["effect"].as_str() {
            Some("contact_wall") => &WALL[..],
            _ => &CARRIED[..],
        };
        // Two of the inertias hardly show in this motion, and are those of a usual body.
        let shown = truth
            .iter()
            .filter(|(name, _)| !HARDLY_SHOWN.contains(name));
        for (name, truth) in shown {
            let [low, high] =
                [0, 1].map(|end| finding["intervals_95"][name][end].as_f64().unwrap());
            assert!(
                low <= *truth && *truth <= high,
                "{name} {truth}: {low} to {high}"
            );
        }
    }
}

/// An arm whose joints rub, by a `share` of what they may, and whose currents nobody can scale, with more `physics` than that;
/// recordings begin with `name`.
fn in_amperes(name: &str, seed: u32, share: f64, physics: &str) -> String {
    let viscous = (1..=7).map(|j| {
        format!("- {{effect: viscous_friction, joint: joint{j}, parameters: {{viscous_nms_per_rad: {}}}}}\n", 2.4 * share / f64::from(j))
    });
    let coulomb = (1..=7).map(|j| {
        format!(
            "- {{effect: coulomb_friction, joint: joint{j}, parameters: {{coulomb_nm: {}}}}}\n",
            1.8 * share / f64::from(j)
        )
    });
    let points = "{points: {speed: 0.5, acceleration_rad_s2: 4, rest_s: [0.1, 0.3], range: 0.6, min_height_m: 0.13}}";
    let waves =
        "{fourier: {period_s: 10, harmonics: 5, speed: 0.6, acceleration_rad_s2: 5, range: 0.6}}";
    let recordings = [points, waves, points].into_iter().enumerate();
    let recordings = recordings
        .map(|(k, motion)| format!("- {{name: {name}{k}, duration_s: 12, motion: {motion}}}\n"));
    format!(
        "version: 1\nname: {name}\nrobot: {}\nseed: {seed}\nrate_hz: 100\nphysics:\n{}{}\
         - {{effect: load_dependent_friction, joint: joint2, parameters: {{coefficient: 0.06}}}}\n{physics}\
         effort_unit: A\ntorque_constants_nm_per_a: {{joint1: 11, joint2: 10, joint3: 8, joint4: 8, joint5: 6, joint6: 5, joint7: 5}}\n\
         sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}\nrecordings:\n{}",
        bundled().join("demo_arm.urdf").display(),
        viscous.collect::<String>(),
        coulomb.collect::<String>(),
        recordings.collect::<String>()
    )
}

#[test]
fn what_changed_since_the_unloaded_arm_is_weighed_in_amperes_too_beside_friction_that_fell() {
    let folder = tempfile::tempdir().unwrap();
    let payload = "- {effect: payload, parameters: {mass_kg: 0.8, com_x_m: 0.01, com_y_m: -0.02, com_z_m: 0.06, \
                   ixx_kgm2: 0.001, iyy_kgm2: 0.001, izz_kgm2: 0.001}}\n";
    simulate(folder.path(), &in_amperes("free", 5, 1.0, ""));
    simulate(folder.path(), &in_amperes("loaded", 6, 0.7, payload));
    let robot = bundled().join("demo_arm.urdf");
    let (free, loaded) = (folder.path().join("free"), folder.path().join("loaded"));
    let twin = free.join("twin.yaml");
    let names = |name: &str| {
        [0, 1, 2].map(|k| {
            folder
                .path()
                .join(format!("{name}{k}.mcap"))
                .to_str()
                .unwrap()
                .to_owned()
        })
    };
    let run = |out: &Path, recordings: &[String; 3], more: &[&str]| {
        let mut arguments = vec![
            "--robot",
            robot.to_str().unwrap(),
            "--effort-unit",
            "A",
            "--fit",
        ];
        arguments.extend([
            recordings[0].as_str(),
            &recordings[1],
            "--holdout",
            &recordings[2],
        ]);
        arguments.extend(more);
        explain(out, &arguments);
    };
    run(&free, &names("free"), &[]);
    run(
        &loaded,
        &names("loaded"),
        &["--twin", twin.to_str().unwrap()],
    );
    let report = report(&loaded);
    let findings = report["findings"].as_array().unwrap();
    let is = |effect: &'static str| move |f: &&serde_json::Value| f["effect"] == effect;
    let finding = findings.iter().find(is("payload")).unwrap();
    // The joints have run in: nothing else but less friction than the twin says.
    for other in findings.iter().filter(|f| !is("payload")(f)) {
        let plain =
            ["coulomb_friction", "viscous_friction"].contains(&other["effect"].as_str().unwrap());
        let parameters = other["parameters"].as_object().unwrap();
        assert!(
            plain && parameters.values().all(|v| v.as_f64() < Some(0.0)),
            "{other}"
        );
    }
    let sentence = |f: &serde_json::Value| {
        f["sentence"]
            .as_str()
            .unwrap()
            .contains("less Coulomb friction than the twin says")
    };
    assert!(findings.iter().any(sentence));
    let [low, high] = [0, 1].map(|end| finding["intervals_95"]["mass_kg"][end].as_f64().unwrap());
    assert!(
        low < 0.8 && 0.8 < high && high - low < 0.4,
        "{low} to {high} kg"
    );
    let of = |which: &str| -> f64 {
        let joints = report[which].as_array().unwrap().iter();
        joints
            .filter_map(serde_json::Value::as_f64)
            .map(|rms| rms * rms)
            .sum()
    };
    assert!(of("holdout_rms_after") < 0.05 * of("holdout_rms_before"));
}
