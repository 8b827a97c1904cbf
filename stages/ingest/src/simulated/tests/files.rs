//! The recordings of a scenario and their labels.

use std::path::PathBuf;

use super::*;

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
fn the_motion_of_a_recording_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    make(1, folder.path());
    let again = ideal(
        &format!(
            "duration_s: 4, motion: {{recorded: {{path: {:?}, topic: /joint_commands}}}}",
            folder.path().join("b.mcap")
        ),
        "",
    );
    let of_b = scenario(
        "{version: 1, robot: demo_arm.urdf, seed: 1, rate_hz: 1000, recordings: [\
          {name: a, duration_s: 2, motion: {points: {}}}, \
          {name: b, duration_s: 8, motion: {fourier: {}}}]}",
    );
    let mut first = Simulation::new(&of_b, &arm(), 1).unwrap();
    let mut fastest = 0.0_f64;
    for reading in readings(&again) {
        let first = first.next_reading().unwrap().unwrap();
        for j in 0..N {
            let error = reading.command_position[j] - first.command_position[j];
            assert!(error.abs() < 1e-3, "joint {j}: {error}");
            fastest = fastest.max(reading.velocity[j].abs());
        }
    }
    assert!(fastest > 0.3, "{fastest}");
}

#[test]
fn the_motion_of_a_table_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let position = |t: f64| 0.3 * (1.0 - (2.0 * t).cos());
    let rows = (0..=200).map(|k| {
        let t = 0.01 * f64::from(k);
        format!("{t}{}\n", format!(",{}", position(t)).repeat(N))
    });
    let path = folder.path().join("next.csv");
    std::fs::write(&path, rows.collect::<String>()).unwrap();
    let motion = format!(
        "duration_s: 2, motion: {{recorded: {{path: {path:?}, \
         columns: {{time: {{number: 1}}, position: {{first: 2}}}}}}}}"
    );
    for (k, reading) in readings(&ideal(&motion, "")).iter().enumerate() {
        let error = reading.command_position[0] - position(0.001 * k as f64);
        assert!(error.abs() < 1e-3, "reading {k}: {error}");
    }
}
