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
pub fn simulate(folder: &Path, text: &str) {
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
