//! `tauscope physics` and `tauscope weeks`: a night's numbers, and what weeks of them say.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::Path;

use crate::common::{Out, bundled, shared, tauscope};
use serde_json::Value;

/// `tauscope physics --json` of these recordings into `history`.
fn night(history: &Path, arguments: &[&str], recordings: &[std::path::PathBuf]) -> Vec<Value> {
    let mut command = tauscope();
    command
        .arg("physics")
        .args(recordings)
        .args(arguments)
        .arg("--json");
    command.arg("--out").arg(history);
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

fn weeks(history: &Path, arguments: &[&str]) -> Value {
    let mut command = tauscope();
    command
        .arg("weeks")
        .arg(history)
        .args(arguments)
        .arg("--json");
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap()
}

#[test]
fn a_night_is_a_table_by_cell_and_date_with_each_number_and_its_interval() {
    let folder = tempfile::tempdir().unwrap();
    let data = bundled();
    let urdf = data.join("demo_arm.urdf");
    let recordings = [
        data.join("demo_train_points.mcap"),
        data.join("demo_train_sweep.mcap"),
    ];
    let arguments = [
        "--robot",
        urdf.to_str().unwrap(),
        "--cell",
        "press-1",
        "--arm",
        "A-17",
    ];
    let rows = night(folder.path(), &arguments, &recordings);
    let one = |joint: &str, quantity: &str| {
        let found = rows
            .iter()
            .find(|row| row["joint"] == joint && row["quantity"] == quantity);
        found.unwrap_or_else(|| panic!("{joint} {quantity}: {rows:?}"))
    };
    // The friction that tests/data/demo.scenario.yaml gives the arm.
    for (joint, quantity, truth) in [
        ("joint1", "coulomb_nm", 0.9),
        ("joint3", "coulomb_nm", 0.6),
        ("joint2", "viscous_nms_per_rad", 1.5),
        ("joint5", "viscous_nms_per_rad", 0.3),
        ("joint2", "gain", 1.0),
    ] {
        let row = one(joint, quantity);
        let half = 0.5 * (number(row, "high_95") - number(row, "low_95"));
        let error = (number(row, "value") - truth).abs();
        assert!(error < 2.0 * half && half < 0.2 * truth, "{row}");
    }
    let dates: Vec<_> = std::fs::read_dir(folder.path().join("cell=press-1"))
        .unwrap()
        .collect();
    assert_eq!(dates.len(), 1);
    let cells = weeks(folder.path(), &[]);
    assert_eq!(cells[0]["arm"], "A-17");
    assert_eq!(cells[0]["findings"].as_array().unwrap().len(), 0);
    assert_eq!(cells[0]["followed"].as_array().unwrap().len(), rows.len());
}

#[test]
fn beside_the_explained_twin_the_numbers_are_the_same_and_name_the_twin() {
    let folder = tempfile::tempdir().unwrap();
    let data = bundled();
    let (urdf, twin) = (data.join("demo_arm.urdf"), data.join("demo.explained.yaml"));
    let recordings = [
        data.join("demo_train_points.mcap"),
        data.join("demo_train_sweep.mcap"),
    ];
    let arguments = ["--robot", urdf.to_str().unwrap()];
    let bare = night(&folder.path().join("bare"), &arguments, &recordings);
    let arguments = [&arguments[..], &["--twin", twin.to_str().unwrap()]].concat();
    let beside = night(&folder.path().join("beside"), &arguments, &recordings);
    for row in bare.iter().filter(|row| row["quantity"] == "coulomb_nm") {
        let same = beside
            .iter()
            .find(|other| other["joint"] == row["joint"] && other["quantity"] == row["quantity"]);
        let same = same.unwrap();
        let half = number(row, "high_95") - number(row, "value");
        assert!(
            (number(row, "value") - number(same, "value")).abs() < 2.0 * half,
            "{row} {same}"
        );
        assert_eq!(same["twin_sha256"].as_str().unwrap().len(), 64);
    }
}

#[test]
fn a_page_of_the_week_stands_alone_and_no_table_is_replaced_without_force() {
    let folder = tempfile::tempdir().unwrap();
    let data = bundled();
    let urdf = data.join("demo_arm.urdf");
    let history = folder.path().join("history");
    let recordings = [data.join("demo_train_sweep.mcap")];
    let arguments = ["--robot", urdf.to_str().unwrap(), "--cell", "press-1"];
    night(&history, &arguments, &recordings);
    let mut again = tauscope();
    again
        .arg("physics")
        .args(&recordings)
        .args(arguments)
        .arg("--out")
        .arg(&history);
    let again = Out::of(again);
    assert_eq!(again.code, 2, "{}", again.stderr);
    assert!(again.stderr.contains("--force"), "{}", again.stderr);
    let mut command = tauscope();
    command
        .arg("weeks")
        .arg(&history)
        .arg("--out")
        .arg(folder.path().join("pages"));
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    // The recording is of long ago.
    let stale = "press-1: stale, the newest night was ";
    assert!(out.stdout.contains(stale), "{}", out.stdout);
    let page = std::fs::read_to_string(folder.path().join("pages/press-1.html")).unwrap();
    assert!(page.contains("Stale: the newest night was "), "{page}");
    assert!(
        page.contains("<style>") && page.contains("<svg") && !page.contains("href=\"/"),
        "{page}"
    );
}

/// Two real geared motors through a day, seven captures each: one stays as it is, the other loses friction while it
/// warms: some 4 % of its Coulomb friction in a fit of all moving samples (7 % at even speeds, which holds viscous
/// friction as well).
#[test]
fn of_two_real_motors_one_is_stable_and_the_others_loss_is_warmth() {
    let Some(shared) = shared("of_two_real_motors_one_is_stable_and_the_others_loss_is_warmth")
    else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let urdf = shared.join("robots/actuator.urdf");
    for motor in ["m1", "m2"] {
        for capture in [
            "r1_g1", "r1_g2", "r2_g1", "r2_g2", "r3_g1", "r3_g2", "r3_g3",
        ] {
            let recording = shared.join(format!("recordings/actuators/{motor}_{capture}.mcap"));
            let arguments = [
                "--robot",
                urdf.to_str().unwrap(),
                "--cell",
                motor,
                "--temperature-topic",
                "/mos_temperature",
            ];
            night(folder.path(), &arguments, &[recording]);
        }
    }
    let cells = weeks(folder.path(), &[]);
    let coulomb = |cell: usize| {
        let followed = cells[cell]["followed"].as_array().unwrap();
        followed
            .iter()
            .find(|one| one["quantity"] == "coulomb")
            .unwrap()
            .clone()
    };
    let values = |one: &Value| -> Vec<f64> {
        let estimates = one["estimates"].as_array().unwrap();
        estimates.iter().map(|one| number(one, "value")).collect()
    };
    let (steady, warming) = (coulomb(0), coulomb(1));
    println!("{:?}\n{:?}", values(&steady), values(&warming));
    assert_eq!(steady["so_far"], "stable", "{steady}");
    assert_eq!(warming["so_far"], "warmth", "{warming}");
    let of = values(&warming);
    let loss = 1.0 - of[6] / of[0];
    assert!((0.02..0.10).contains(&loss), "{loss}");
    let of = values(&steady);
    assert!(
        of.iter().all(|value| (value / of[0] - 1.0).abs() < 0.03),
        "{of:?}"
    );
}
