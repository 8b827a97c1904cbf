//! An hour of contact-free cycles with friction that warms up (`tests/data/clean_hour.scenario.yaml`), in which every
//! alarm is false. The tests run a short form; the whole hour is
//! `cargo test --release --test program clean_hour -- --ignored`.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::{Out, bundled, tauscope, write};
use serde_json::Value;

const DETECTORS: &str = "virtual_collision_sensor_basic,virtual_collision_sensor,tauscope";

/// Runs `tauscope`, which must succeed.
fn done(more: &[&str], path: &Path, out: &Path) -> Out {
    let mut command = tauscope();
    command.args(more).arg(path).arg("--force");
    command.arg("--out").arg(out);
    let done = Out::of(command);
    assert_eq!(done.code, 0, "{}", done.stderr);
    done
}

/// Simulates the scenario's first `count` contact-free recordings after `change`, trains the detectors on its cold
/// cycles, and expects no alarm in the rest, except for at most `most` alarms of `tauscope`.
fn nobody_cries(count: usize, most: u64, change: impl Fn(String) -> String) {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let robot = bundled().join("demo_arm.urdf").display().to_string();
    let scenario = std::fs::read_to_string(bundled().join("clean_hour.scenario.yaml")).unwrap();
    let lines = scenario.lines().filter(|line| {
        let number = line
            .split("name: clean_")
            .nth(1)
            .and_then(|rest| rest.get(..2));
        number
            .and_then(|number| number.parse::<usize>().ok())
            .is_none_or(|number| number < count)
    });
    let lines: Vec<&str> = lines.collect();
    let constants = lines
        .iter()
        .find(|line| line.starts_with("torque_constants"))
        .unwrap();
    let text = lines
        .join("\n")
        .replace("robot: demo_arm.urdf", &format!("robot: {robot}"));
    let scenario = write(&path("scenario.yaml"), &change(text));
    done(&["simulate"], &scenario, folder.path());

    let clean: Vec<String> = (0..count)
        .map(|number| format!("clean_{number:02}.mcap"))
        .collect();
    let set = format!(
        "set: clean_hour\nrobot: {robot}\nlabels: labels.json\neffort_unit: A\n{constants}\ncycle_s: 8\n\
         topics: {{state: /joint_states}}\ntrain: [learn.mcap]\nvalidation: [cold.mcap]\ntest: [{}]\n",
        clean.join(", ")
    );
    let set = write(&path("set.yaml"), &set);
    let said = done(
        &["evaluate", "--json", "--detectors", DETECTORS],
        &set,
        &path("out"),
    );
    let summary: Value = serde_json::from_str(&said.stdout).unwrap();
    let detectors = summary["detectors"].as_array().unwrap();
    assert_eq!(detectors.len(), 3);
    for detector in detectors {
        let found = detector["seeds"][0]["false_alarms"].as_u64().unwrap();
        let is_own = detector["detector"] == "tauscope";
        assert!(found <= if is_own { most } else { 0 }, "{detector}");
    }
}

#[test]
fn two_minutes_of_a_cold_arm_raise_no_alarm() {
    nobody_cries(2, 0, |text| {
        text.replace("duration_s: 300", "duration_s: 60")
    });
}

#[test]
#[ignore = "five minutes of simulation"]
fn an_hour_of_clean_cycles_raises_no_alarm() {
    nobody_cries(12, 0, |text| text);
}

#[test]
#[ignore = "five minutes of simulation"]
fn an_hour_of_twice_the_noise_raises_no_more_alarms_than_are_wished_for() {
    // The default setting of `tauscope` allows five.
    nobody_cries(12, 5, |text| {
        let noisier = "effort_noise_of_limit: 0.004";
        text.replace("seed: 5", "seed: 6")
            .replace("effort_noise_of_limit: 0.002", noisier)
    });
}
