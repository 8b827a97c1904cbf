//! No command overwrites a file that it did not create in this run, except with `--force`.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::ffi::OsString;
use std::path::Path;

use crate::common::{Out, bundled, write};

/// Runs a command twice, then with `--force`; the output of the second run must contain `named`.
fn twice(arguments: &[&str], out: &Path, named: &[&str]) {
    let all = |more: &[&str]| -> Vec<OsString> {
        let words = arguments.iter().chain(more).map(OsString::from);
        words.chain(["--out".into(), out.into()]).collect()
    };
    let first = Out::answer(all(&[]));
    assert_eq!(first.code, 0, "{arguments:?}: {first:?}");
    let before = contents(out);
    let second = Out::answer(all(&[]));
    assert_eq!(second.code, 2, "{arguments:?}: {second:?}");
    for name in named.iter().chain(&["--force"]) {
        assert!(second.stderr.contains(name), "{name}: {}", second.stderr);
    }
    assert_eq!(contents(out), before, "{arguments:?}");
    let forced = Out::answer(all(&["--force"]));
    assert_eq!(forced.code, 0, "{arguments:?}: {forced:?}");
}

/// Name, time of modification and length of each file.
fn contents(out: &Path) -> Vec<(OsString, std::time::SystemTime, u64)> {
    if out.is_file() {
        let file = out.metadata().unwrap();
        return vec![(out.into(), file.modified().unwrap(), file.len())];
    }
    let mut all: Vec<_> = std::fs::read_dir(out)
        .unwrap()
        .map(|entry| {
            let entry = entry.unwrap();
            let file = entry.metadata().unwrap();
            (entry.file_name(), file.modified().unwrap(), file.len())
        })
        .collect();
    all.sort();
    all
}

#[test]
fn a_second_run_into_one_place_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let robot = bundled().join("demo_arm.urdf").display().to_string();
    let recording = bundled().join("demo_validation.mcap").display().to_string();
    let scenario = write(
        &folder.path().join("scenario.yaml"),
        &format!(
            "{{version: 1, robot: {robot:?}, seed: 1, rate_hz: 250, recordings: [\
             {{name: a, duration_s: 2, motion: {{fourier: {{}}}}}}, {{name: b, duration_s: 2, motion: {{fourier: {{}}}}}}]}}"
        ),
    );
    let at = |name: &str| folder.path().join(name);
    let scenario = scenario.display().to_string();
    twice(
        &["simulate", &scenario],
        &at("made"),
        &["3 files", "a.mcap", "labels.json"],
    );
    twice(
        &["calibrate", "--robot", &robot, &recording],
        &at("twin.yaml"),
        &["twin.yaml is there already"],
    );
    let pipeline = crate::common::root()
        .join("pipeline.yaml")
        .display()
        .to_string();
    twice(
        &["replay", "--pipeline", &pipeline, &recording],
        &at("replayed"),
        &["demo_validation.mcap", "summary.parquet"],
    );
    let (a, b) = (
        at("made/a.mcap").display().to_string(),
        at("made/b.mcap").display().to_string(),
    );
    twice(
        &["explain", "--robot", &robot, "--fit", &a, "--holdout", &b],
        &at("explained"),
        &["report.json", "b.csv"],
    );
    // Only the explanation knows the name of a motion to record next.
    std::fs::create_dir(at("moved")).unwrap();
    write(&at("moved/next_viscous_joint1.csv"), "0,0\n");
    let moved = at("moved").display().to_string();
    let refused = Out::answer([
        "explain",
        "--robot",
        &robot,
        "--fit",
        &a,
        "--holdout",
        &b,
        "--out",
        &moved,
    ]);
    assert_eq!(refused.code, 2, "{refused:?}");
    assert!(
        refused.stderr.contains("next_viscous_joint1.csv is there"),
        "{refused:?}"
    );
}
