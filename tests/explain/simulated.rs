//! Several effects at once, in the simulated cell.

use std::path::Path;

use super::{explain, named, pair, report};
use crate::common::{Out, bundled, tauscope, write};

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
pub fn simulate(folder: &Path, text: &str) {
    let scenario = write(&folder.join("scenario.yaml"), text);
    let mut simulate = tauscope();
    simulate
        .args(["simulate", "--force"])
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
        // Two of the inertias hardly affect this motion, and have the values of a typical body.
        let shown = truth
            .iter()
            .filter(|(name, _)| !HARDLY_SHOWN.contains(name));
        for (name, truth) in shown {
            let [low, high] =
                [0, 1].map(|end| finding["intervals_95"][name][end].as_f64().unwrap());
            // Eight 95 % intervals miss once in three draws; three standard deviations miss once in fifty.
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * 3.0 / 1.96);
            assert!(
                (truth - middle).abs() <= half,
                "{name} {truth}: {low} to {high}"
            );
        }
    }
}

#[test]
fn a_link_that_is_another_body_is_described_where_no_name_fits() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let robot = bundled().join("demo_arm.urdf");
    let waves = |name: &str, period_s: u32, speed: f64| {
        format!(
            "- {{name: {name}, duration_s: 8, motion: {{fourier: {{period_s: {period_s}, harmonics: 5, speed: {speed}, \
             acceleration_rad_s2: 5, range: 0.6}}}}}}\n"
        )
    };
    let text = format!(
        "version: 1\nname: body\nrobot: {}\nseed: 8\nrate_hz: 100\nphysics:\n\
         - {{effect: link_inertia, link: link4, parameters: {{delta_mass_kg: 0.3, delta_first_moment_x_kgm: 0.03, delta_first_moment_y_kgm: -0.02, \
         delta_first_moment_z_kgm: 0.04, delta_origin_ixx_kgm2: 0.02, delta_origin_ixy_kgm2: 0, delta_origin_ixz_kgm2: 0, \
         delta_origin_iyy_kgm2: 0.02, delta_origin_iyz_kgm2: 0, delta_origin_izz_kgm2: 0.01}}}}\n\
         sensors: {{position_noise_rad: 0.00001, velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}\nrecordings:\n{}{}{}",
        robot.display(),
        waves("r0", 8, 0.6),
        waves("r1", 4, 0.5),
        waves("r2", 8, 0.5)
    );
    simulate(folder.path(), &text);
    let [r0, r1, r2] = ["r0.mcap", "r1.mcap", "r2.mcap"].map(path);
    let out = path("out");
    let mut arguments = vec![
        "--robot",
        robot.to_str().unwrap(),
        "--effort-unit",
        "Nm",
        "--fit",
    ];
    arguments.extend([r0.to_str().unwrap(), r1.to_str().unwrap()]);
    arguments.extend(["--holdout", r2.to_str().unwrap()]);
    // Its mass and its centre differ, too: without these names a body is the only remaining hypothesis.
    arguments.extend([
        "--without",
        "link_mass",
        "--without",
        "link_com",
        "--without",
        "payload",
    ]);
    explain(&out, &arguments);
    let report = report(&out);
    let finding = &report["findings"][0];
    assert_eq!(
        (&finding["effect"], &finding["link"]),
        (&"unknown".into(), &"link4".into())
    );
    assert_eq!(report["verdict"], "unknown_remains");
    let mass = finding["parameters"]["delta_mass_kg"].as_f64().unwrap();
    assert!((mass - 0.3).abs() < 0.03, "{mass} kg");
    let rms = |of: &str| -> Vec<f64> {
        let all = report[of].as_array().unwrap().iter();
        all.map(|value| value.as_f64().unwrap()).collect()
    };
    let [before, after, noise] =
        ["holdout_rms_before", "holdout_rms_after", "noise_floor"].map(rms);
    assert!(before[1] > 3.0 * noise[1] && before[3] > 3.0 * noise[3]);
    let rest = after.iter().zip(&noise);
    assert!(
        rest.into_iter().all(|(after, noise)| *after < 1.2 * noise),
        "{after:?}"
    );
    // The new twin and its URDF contain the body.
    let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    assert!(read("twin.yaml").contains("link_inertia"));
    assert_ne!(read("robot.urdf"), std::fs::read_to_string(&robot).unwrap());
}

/// The bundled arm with a body of 0.3 kg at its tool and a finger that is not recorded: a gripper that is not
/// mounted.
fn with_gripper(folder: &Path) -> std::path::PathBuf {
    let body = |mass: f64, z: f64, inertia: f64| {
        format!(
            "<inertial><origin xyz='0 0 {z}'/><mass value='{mass}'/><inertia ixx='{inertia}' ixy='0' ixz='0' \
             iyy='{inertia}' iyz='0' izz='{inertia}'/></inertial>"
        )
    };
    let gripper = format!(
        "<link name='gripper'>{}</link><link name='finger'>{}</link>\
         <joint name='flange' type='fixed'><parent link='tool'/><child link='gripper'/></joint>\
         <joint name='grip' type='prismatic'><parent link='gripper'/><child link='finger'/><axis xyz='0 1 0'/>\
         <limit lower='0' upper='0.04' effort='20' velocity='1'/></joint></robot>",
        body(0.29, 0.06, 8e-4),
        body(0.01, 0.1, 1e-5),
    );
    let urdf = std::fs::read_to_string(bundled().join("demo_arm.urdf")).unwrap();
    write(
        &folder.join("gripper.urdf"),
        &urdf.replace("</robot>", &gripper),
    )
}

#[test]
fn a_gripper_of_the_urdf_that_is_not_mounted_is_told_with_its_mass() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let text = scenario();
    let (head, tail) = text.split_once("physics:").unwrap();
    let (_, tail) = tail.split_once("sensors:").unwrap();
    simulate(folder.path(), &format!("{head}sensors:{tail}"));
    let recordings = ["r0.mcap", "r1.mcap", "r2.mcap", "r3.mcap"].map(path);
    let [r0, r1, r2, r3] = recordings.each_ref().map(|path| path.to_str().unwrap());
    let (robot, out) = (with_gripper(folder.path()), path("out"));
    let robot = robot.to_str().unwrap();
    explain(
        &out,
        &["--robot", robot, "--fit", r0, r1, r2, "--holdout", r3],
    );
    let report = report(&out);
    let note = report["notes"][0].as_str().unwrap();
    assert!(note.contains("No recording names grip"), "{note}");
    let findings = report["findings"].as_array().unwrap();
    assert_eq!(findings.len(), 1, "{findings:?}");
    let found = &findings[0];
    assert_eq!(
        (&found["effect"], &found["link"]),
        (&"unknown".into(), &"tool".into())
    );
    assert_eq!(found["parameters"]["kind"], "absent_tool");
    let [low, high] = [0, 1].map(|end| found["intervals_95"]["mass_kg"][end].as_f64().unwrap());
    // The masses of the other bodies may be wrong, too.
    assert!(
        low <= 0.3 && 0.3 <= high && high - low < 0.15,
        "{low} {high}"
    );
}
