//! Changes since the twin of the unloaded arm was made, from motor currents without torque constants.

use std::path::PathBuf;

use serde_json::Value;

use super::simulated::simulate;
use super::{explain, report};
use crate::common::bundled;

/// An arm with joint friction, and its initial twin.
struct Arm {
    folder: tempfile::TempDir,
}

impl Arm {
    /// Explains the arm in its initial state and keeps the twin.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let arm = Self { folder };
        simulate(arm.folder.path(), &scenario("free", 5, 1.0, "", ""));
        arm.explained("free", "free", None);
        arm
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Report on recordings whose names begin with `name`, relative to the twin of another report if one is given.
    fn explained(&self, out: &str, name: &str, beside: Option<&str>) -> Value {
        let robot = bundled().join("demo_arm.urdf");
        let recordings = [0, 1, 2].map(|k| self.path(&format!("{name}{k}.mcap")));
        let [r0, r1, r2] = recordings.each_ref().map(|path| path.to_str().unwrap());
        let mut arguments = vec!["--robot", robot.to_str().unwrap(), "--effort-unit", "A"];
        arguments.extend(["--fit", r0, r1, "--holdout", r2]);
        let twin = beside.map(|beside| self.path(&format!("{beside}/twin.yaml")));
        if let Some(twin) = &twin {
            arguments.extend(["--twin", twin.to_str().unwrap()]);
        }
        let out = self.path(out);
        explain(&out, &arguments);
        report(&out)
    }

    /// Findings in a scenario, relative to the twin of the arm in its initial state.
    fn changed(&self, name: &str, scenario: &str) -> Vec<Value> {
        simulate(self.folder.path(), scenario);
        let report = self.explained(name, name, Some("free"));
        report["findings"].as_array().unwrap().clone()
    }
}

/// Friction is multiplied by `share`; the second recording has `contacts`.
fn scenario(name: &str, seed: u32, share: f64, physics: &str, contacts: &str) -> String {
    let friction = (1..=7).map(|j| {
        let (viscous, coulomb) = (2.4 * share / f64::from(j), 1.8 * share / f64::from(j));
        format!(
            "- {{effect: viscous_friction, joint: joint{j}, parameters: {{viscous_nms_per_rad: {viscous}}}}}\n\
             - {{effect: coulomb_friction, joint: joint{j}, parameters: {{coulomb_nm: {coulomb}}}}}\n"
        )
    });
    let points = "{points: {speed: 0.5, acceleration_rad_s2: 4, rest_s: [0.1, 0.3], range: 0.6, min_height_m: 0.13}}";
    let waves =
        "{fourier: {period_s: 10, harmonics: 5, speed: 0.6, acceleration_rad_s2: 5, range: 0.6}}";
    format!(
        "version: 1\nname: {name}\nrobot: {}\nseed: {seed}\nrate_hz: 100\nphysics:\n{}\
         - {{effect: load_dependent_friction, joint: joint2, parameters: {{coefficient: 0.06}}}}\n{physics}\
         effort_unit: A\ntorque_constants_nm_per_a: {{joint1: 11, joint2: 10, joint3: 8, joint4: 8, joint5: 6, joint6: 5, joint7: 5}}\n\
         sensors: {{velocity_noise_rad_s: 0.001, effort_noise_of_limit: 0.002}}\nrecordings:\n\
         - {{name: {name}0, duration_s: 12, motion: {points}}}\n\
         - {{name: {name}1, duration_s: 12, motion: {waves}, contacts: [{contacts}]}}\n\
         - {{name: {name}2, duration_s: 12, motion: {points}}}\n",
        bundled().join("demo_arm.urdf").display(),
        friction.collect::<String>(),
    )
}

fn parameter(finding: &Value, name: &str) -> f64 {
    finding["parameters"][name].as_f64().unwrap()
}

#[test]
fn what_an_arm_carries_is_weighed_in_amperes_too_beside_friction_that_fell() {
    let payload = "- {effect: payload, parameters: {mass_kg: 0.8, com_x_m: 0.01, com_y_m: -0.02, com_z_m: 0.06, \
                   ixx_kgm2: 0.001, iyy_kgm2: 0.001, izz_kgm2: 0.001}}\n";
    let arm = Arm::new();
    let findings = arm.changed("loaded", &scenario("loaded", 6, 0.7, payload, ""));
    let (payloads, others): (Vec<_>, Vec<_>) =
        findings.iter().partition(|f| f["effect"] == "payload");
    let interval = &payloads[0]["intervals_95"]["mass_kg"];
    let [low, high] = [0, 1].map(|end| interval[end].as_f64().unwrap());
    assert!(
        low < 0.8 && 0.8 < high && high - low < 0.4,
        "{low} to {high} kg"
    );
    // The joints have run in: the only other findings are reductions of the twin's friction.
    for other in &others {
        let parameters = other["parameters"].as_object().unwrap();
        let plain = ["coulomb_friction", "viscous_friction"].map(Value::from);
        assert!(
            plain.contains(&other["effect"]) && parameters.values().all(|v| v.as_f64() < Some(0.0)),
            "{other}"
        );
        let sentence = other["sentence"].as_str().unwrap();
        assert!(sentence.contains("than the twin says"), "{sentence}");
    }
    assert!(!others.is_empty());
    // The new twin contains all changes.
    let again = arm.explained("again", "loaded", Some("loaded"));
    assert_eq!(again["verdict"], "nothing_missing", "{}", again["findings"]);
}

#[test]
fn what_hit_a_moving_arm_is_told_in_newtons_in_amperes_too() {
    let hit = "{link: link5, force_n: [24, -10, 6], t_on_s: 5.0, t_off_s: 5.6, rise_s: 0.02}";
    let findings = Arm::new().changed("hit", &scenario("hit", 7, 1.0, "", hit));
    let pushes: Vec<&Value> = (findings.iter())
        .filter(|f| f["effect"] == "external_push")
        .collect();
    let [push] = pushes[..] else {
        panic!("{pushes:?}");
    };
    let link = push["link"].as_str().unwrap();
    assert!(["link4", "link5", "link6"].contains(&link), "{link}");
    let between = |name: &str| push[name].as_f64().unwrap();
    assert!((between("t_start") - 5.0).abs() < 0.1 && (between("t_end") - 5.6).abs() < 0.1);
    let force = ["force_x_n", "force_y_n", "force_z_n"].map(|name| parameter(push, name));
    let along = (force[0] * 24.0 - force[1] * 10.0 + force[2] * 6.0) / 26.7;
    let size = force.iter().map(|f| f * f).sum::<f64>().sqrt();
    assert!(along > 0.9 * size, "{force:?}");
    assert!((20.0..34.0).contains(&along), "{force:?}");
}
