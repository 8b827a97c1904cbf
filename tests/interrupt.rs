//! Ctrl-C and SIGTERM end every command normally: existing files are complete, and the progress is reported. A stage
//! that does not terminate is named and killed.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::common::live::{Live, signal, stage, wait_until};
use crate::common::{Out, bundled, tauscope, write};

/// Runs `command`, sends it a signal when `ripe`, and returns its output.
fn interrupted(mut command: Command, name: &str, ripe: impl Fn() -> bool) -> Out {
    let child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until("the work has begun", ripe);
    signal(child.id(), name);
    let out = child.wait_with_output().unwrap();
    Out {
        code: out.status.code().unwrap_or(-1),
        stdout: String::from_utf8(out.stdout).unwrap(),
        stderr: String::from_utf8(out.stderr).unwrap(),
    }
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into())
        .collect();
    files.sort();
    files
}

/// A scenario with one short recording and one that takes too long to wait for.
fn long_scenario(folder: &Path) -> PathBuf {
    let robot = bundled().join("demo_arm.urdf");
    write(
        &folder.join("long.yaml"),
        &format!(
            "version: 1
robot: {}
seed: 1
rate_hz: 500
recordings:
- {{name: short, duration_s: 1, motion: {{fourier: {{}}}}}}
- {{name: long, duration_s: 50000, motion: {{fourier: {{}}}}}}
",
            robot.display()
        ),
    )
}

#[test]
fn simulate_keeps_the_recordings_that_are_whole() {
    for name in ["INT", "TERM"] {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let mut command = tauscope();
        command
            .arg("simulate")
            .arg(long_scenario(folder.path()))
            .arg("--out")
            .arg(&out);
        let long = out.join("long.mcap.part");
        let said = interrupted(command, name, || {
            long.metadata().is_ok_and(|file| file.len() > 50_000)
        });
        assert_eq!(said.code, 1, "{said:?}");
        assert!(
            said.stderr.contains("interrupted after 1 of 2 recordings"),
            "{said:?}"
        );
        assert_eq!(files(&out), [PathBuf::from("short.mcap")]);
    }
}

/// A recording that takes long to process.
fn long_recording(folder: &Path) -> PathBuf {
    let robot = bundled().join("demo_arm.urdf");
    let scenario = write(
        &folder.join("scenario.yaml"),
        &format!(
            "version: 1
robot: {}
seed: 1
rate_hz: 1000
recordings:
- {{name: long, duration_s: 150, motion: {{fourier: {{}}}}}}
",
            robot.display()
        ),
    );
    let made = Out::answer([
        "simulate".as_ref(),
        scenario.as_os_str(),
        "--out".as_ref(),
        folder.as_os_str(),
    ]);
    assert_eq!(made.code, 0, "{made:?}");
    folder.join("long.mcap")
}

#[test]
fn replay_keeps_what_is_whole_and_the_others_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let long = long_recording(folder.path());
    let robot = bundled().join("demo_arm.urdf");
    let out = folder.path().join("out");
    let pipeline = write(
        &folder.path().join("pipeline.yaml"),
        &format!(
            "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {long}}}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: record, inputs: [ingest, twin], record: {{mcap: out.mcap}}}}
",
            robot = robot.display(),
            long = long.display(),
        ),
    );
    let mut replay = tauscope();
    replay.arg("replay").arg("--pipeline").arg(pipeline);
    replay.arg("--out").arg(&out);
    replay.arg(bundled().join("demo.mcap")).arg(&long);
    let part = out.join("long.mcap.part");
    let said = interrupted(replay, "INT", || {
        part.metadata().is_ok_and(|file| file.len() > 50_000)
    });
    assert_eq!(said.code, 1, "{said:?}");
    assert!(
        said.stderr
            .contains("interrupted after 1 of 2 recordings; its results are in "),
        "{said:?}"
    );
    let left = files(&out);
    assert!(
        left.contains(&"demo.mcap".into()) && left.contains(&"summary.parquet".into()),
        "{left:?}"
    );
    assert!(
        !left
            .iter()
            .any(|name| name.to_string_lossy().starts_with("long")),
        "{left:?}"
    );

    // A command that computes first and writes at its end is stopped at once.
    let twin = folder.path().join("twin.yaml");
    let report = folder.path().join("report");
    let mut calibrate = tauscope();
    calibrate
        .arg("calibrate")
        .arg("--robot")
        .arg(&robot)
        .arg(&long)
        .arg("--out")
        .arg(&twin);
    let mut explain = tauscope();
    explain
        .arg("explain")
        .arg("--robot")
        .arg(&robot)
        .arg("--fit")
        .arg(&long)
        .arg(bundled().join("demo_validation.mcap"));
    explain.arg("--out").arg(&report);
    for (command, result) in [(calibrate, &twin), (explain, &report.join("report.json"))] {
        let began = std::time::Instant::now();
        let said = interrupted(command, "TERM", || {
            began.elapsed() > Duration::from_millis(700)
        });
        assert_eq!(said.code, 1, "{said:?}");
        assert!(said.stderr.starts_with("interrupted at "), "{said:?}");
        assert!(said.stderr.contains("no result was written"), "{said:?}");
        assert!(!result.exists());
    }
    let repaired = folder.path().join("long.repaired.mcap.part");
    let mut repair = tauscope();
    repair.arg("repair").arg(&long);
    let said = interrupted(repair, "INT", || {
        repaired.metadata().is_ok_and(|file| file.len() > 50_000)
    });
    assert_eq!(said.code, 1, "{said:?}");
    assert!(said.stderr.starts_with("interrupted"), "{said:?}");
    let parts = files(folder.path());
    assert!(
        !parts
            .iter()
            .any(|name| name.to_string_lossy().contains("part")),
        "{parts:?}"
    );
}

#[test]
fn init_takes_away_what_it_has_written() {
    let folder = tempfile::tempdir().unwrap();
    let cell = folder.path().join("cell");
    let mut init = tauscope();
    init.arg("init").arg("--out").arg(&cell);
    init.arg("--robot").arg(bundled().join("demo_arm.urdf"));
    for recording in [
        "demo_train_points.mcap",
        "demo_train_sweep.mcap",
        "demo_validation.mcap",
    ] {
        init.arg(bundled().join(recording));
    }
    // At this point the twin is explained, and the detector is being trained.
    let said = interrupted(init, "INT", || cell.join("set.yaml").exists());
    assert_eq!(said.code, 1, "{said:?}");
    assert!(
        said.stderr.contains("what was written is removed"),
        "{said:?}"
    );
    assert!(!cell.exists(), "{:?}", files(&cell));
}

/// A folder with a `pipeline.yaml` that plays the bundled recording in real time into these `stages`.
fn realtime(stages: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: realtime}}}}
{stages}",
        robot = bundled().join("demo_arm.urdf").display(),
        recording = bundled().join("demo.mcap").display(),
    );
    write(&folder.path().join("pipeline.yaml"), &text);
    folder
}

#[test]
fn a_stage_that_does_not_end_is_named_and_killed() {
    let folder = realtime(
        r#"- {name: deaf, input: ingest, outside: {command: [sleep, "1000"]}}
- {name: record, inputs: [ingest], record: {mcap: out.mcap}}
"#,
    );
    let mut live = Live::start(folder.path(), &[]);
    live.wait_for("warning: stage `deaf` has not begun after 4 s");
    signal(live.id(), "INT");
    live.wait_for("warning: stage `deaf` was asked to end and still runs; it is killed in 8 s");
    live.wait_for(
        "error: stage `deaf` did not end when asked to, was killed and is not started again",
    );
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert_eq!(stage(&summary, "deaf")["killed"], true, "{summary}");
    assert_eq!(stage(&summary, "record")["killed"], false, "{summary}");
    assert!(!folder.path().join("out.mcap.part").exists());
}

#[test]
fn a_second_signal_ends_a_run_at_once_and_leaves_no_unfinished_file() {
    let folder = realtime(
        "- {name: twin, input: ingest, twin: {}}
- {name: record, inputs: [ingest, twin], record: {mcap: out.mcap, rerun: {file: out.rrd}}}
",
    );
    let mut live = Live::start(folder.path(), &["--verbose"]);
    live.wait_for("stage `ingest` begins");
    let part = folder.path().join("out.mcap.part");
    wait_until("the recording has begun", || part.exists());
    signal(live.id(), "INT");
    live.wait_for("ending the sources");
    signal(live.id(), "INT");
    let (_, summary) = live.end();
    assert_eq!(stage(&summary, "record")["failed"], false, "{summary}");
    let left = files(folder.path());
    let named: Vec<PathBuf> = ["out.mcap", "out.rrd", "pipeline.yaml"]
        .map(Into::into)
        .into();
    assert_eq!(left, named);
}
