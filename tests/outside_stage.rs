//! A stage from another crate takes a place in a pipeline by name.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::live::{Live, signal, stage};
use crate::common::{bundled, hide_own_package, root, write};

/// Builds the example next to the program under test, and returns where it is.
fn outside_stage() -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_tauscope"));
    let target = program.ancestors().nth(2).unwrap();
    let mut cargo = Command::new(env!("CARGO"));
    cargo
        .args(["build", "--quiet", "--locked", "--manifest-path"])
        .arg(root().join("examples/outside-stage/Cargo.toml"))
        .arg("--target-dir")
        .arg(target);
    hide_own_package(&mut cargo);
    assert!(
        cargo.status().unwrap().success(),
        "the example cannot be built"
    );
    target.join("debug/outside-stage")
}

fn pipeline(folder: &Path, program: &Path, rate: &str) {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: {rate}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: peaks, input: twin, outside: {{command: [{program}], output: detection}}}}
- {{name: record, inputs: [twin, peaks], record: {{mcap: out.mcap}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
        program = program.display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

#[test]
fn a_stage_from_another_crate_takes_part_and_is_looked_after() {
    let program = outside_stage();
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), &program, "fast");
    let (code, summary) = Live::start(folder.path(), &[]).end();
    assert_eq!(code, 0, "{summary}");
    let samples = stage(&summary, "twin")["emitted"].as_u64().unwrap();
    assert!(samples > 0, "{summary}");
    assert_eq!(stage(&summary, "peaks")["received"], samples, "{summary}");
    assert_eq!(stage(&summary, "peaks")["emitted"], samples, "{summary}");
    assert_eq!(
        stage(&summary, "record")["received"],
        2 * samples,
        "{summary}"
    );

    pipeline(folder.path(), &program, "4");
    let mut live = Live::start(folder.path(), &["--force"]);
    let peaks = live.wait_for_stage("peaks");
    live.wait_for_stage("ingest");
    signal(peaks, "KILL");
    live.wait_for("warning: stage `peaks` was killed by signal 9: starting it again");
    live.wait_for_stage("peaks");
    let (_, summary) = live.end();
    assert_eq!(stage(&summary, "peaks")["restarts"], 1, "{summary}");
    assert!(
        stage(&summary, "peaks")["emitted"].as_u64() > Some(0),
        "{summary}"
    );
}
