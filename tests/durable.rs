//! Durability of recordings after a killed recorder, a power cut and a full disk.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::live::{Live, signal, stage, wait_until};
use crate::common::python;
use crate::common::{Out, bundled, root, skipped, write};
use tauscope_archive::Recording;

/// The bundled recording at `rate`, recorded with the settings `record`.
fn pipeline(folder: &Path, rate: &str, record: &str) -> PathBuf {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: {rate}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: record, inputs: [ingest, twin, detect], record: {record}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.join("pipeline.yaml"), &text)
}

fn joint_states(path: &Path) -> u64 {
    let recording = Recording::open(path).unwrap();
    assert!(recording.damage().is_empty(), "{:?}", recording.damage());
    let topic = recording.joint_state_topic("/joint_states").unwrap();
    topic.message_count
}

#[test]
fn what_a_killed_recorder_left_is_repaired_by_its_next_life_and_joined_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    pipeline(folder.path(), "4", "{mcap: out/a.mcap}");
    let mut live = Live::start(folder.path(), &[]);
    let mut recorder = 0;
    for life in 0..2 {
        recorder = live.wait_for_stage("record");
        let part = out.join("a.mcap.part");
        let before = out.join(format!("a.{life}.mcap"));
        wait_until("what was before is repaired and samples flow", || {
            (life == 0 || before.exists()) && part.metadata().is_ok_and(|file| file.len() > 50_000)
        });
        signal(recorder, "KILL");
    }
    let again = live.wait_for_stage("record");
    assert_ne!(again, recorder);
    let heard = live.rest();
    let (code, summary) = live.end();
    assert_eq!(code, 3, "{summary}");
    let said = "which an earlier run left unfinished, was repaired";
    assert!(heard.contains(said), "{heard}");
    let pieces = ["a.1.mcap", "a.2.mcap", "a.mcap"].map(|name| out.join(name));
    let counts: Vec<u64> = pieces.iter().map(|piece| joint_states(piece)).collect();
    assert!(!out.join("a.1.mcap.part").exists() && !out.join("a.mcap.part").exists());

    let repaired = Out::answer([Path::new("repair"), &out]);
    assert_eq!(repaired.code, 0, "{}", repaired.stderr);
    let bag = folder.path().join("out.repaired");
    let joined = bag.join("a.mcap");
    assert_eq!(joint_states(&joined), counts.iter().sum::<u64>());
    assert!(bag.join("metadata.yaml").exists());

    let packages = ["mcap==1.6.0", "mcap-ros2-support==0.6.0"];
    let python = match python::python("python-independent-reader", &packages, "mcap, mcap_ros2") {
        Ok(python) => python,
        Err(why) => return skipped("what_a_killed_recorder_left: the reference reader", &why),
    };
    let mut reader = Command::new(python);
    reader
        .arg(root().join("tests/python/read_archive.py"))
        .arg(&joined);
    let read = Out::of(reader);
    assert_eq!(read.code, 0, "{}", read.stderr);
    let theirs: serde_json::Value = serde_json::from_str(&read.stdout).unwrap();
    let count = &theirs["topics"]["/joint_states"]["count"];
    assert_eq!(count.as_u64(), Some(counts.iter().sum()));
}

#[test]
fn chunks_reach_the_disk_ten_times_a_second() {
    const TEST: &str = "chunks_reach_the_disk_ten_times_a_second";
    let folder = tempfile::tempdir().unwrap();
    let mut try_out = Command::new("strace");
    try_out.args(["-f", "-o", "/dev/null", "true"]);
    if !try_out.status().is_ok_and(|status| status.success()) {
        return skipped(TEST, "strace cannot be run here");
    }
    let file = pipeline(folder.path(), "4", "{mcap: out/a.mcap}");
    let log = folder.path().join("calls");
    let mut traced = Command::new("strace");
    traced
        .args(["-f", "-e", "trace=fdatasync,fsync", "-o"])
        .arg(&log)
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .arg("run")
        .arg(&file);
    let begun = std::time::Instant::now();
    let run = Out::of(traced);
    let took_s = begun.elapsed().as_secs_f64();
    assert_eq!(run.code, 0, "{}", run.stderr);
    let calls = std::fs::read_to_string(log).unwrap();
    let count = |call: &str| calls.lines().filter(|line| line.contains(call)).count();
    let synced = count("fdatasync(");
    assert!(synced >= 10, "{synced} times in {took_s} s");
    assert!(
        (synced as f64) < 10.0 * took_s + 2.0,
        "{synced} times in {took_s} s"
    );
    // The folder is synced when the file is created and when it is renamed, and the file once.
    assert!(count("fsync(") >= 3, "{calls}");
}

#[test]
fn a_full_disk_stops_neither_the_run_nor_the_detection() {
    const TEST: &str = "a_full_disk_stops_neither_the_run_nor_the_detection";
    let folder = tempfile::tempdir().unwrap();
    let small = folder.path().join("small");
    std::fs::create_dir(&small).unwrap();
    let record = "{mcap: \"small/a-{n}.mcap\", compression: none, min_free_mb: 1}";
    let file = pipeline(folder.path(), "4", record);
    // A separate disk, in a namespace that ends with the run. Another program fills it and removes its file.
    let script = format!(
        "mount -t tmpfs -o size=5m none {small} || exit 77
         (sleep 1; head -c 4300000 /dev/zero >{small}/other; sleep 1.5; rm {small}/other) &
         {tauscope} run {file} --json
         code=$?; wait; cp {small}/* {out}; exit $code",
        small = small.display(),
        tauscope = env!("CARGO_BIN_EXE_tauscope"),
        file = file.display(),
        out = folder.path().display(),
    );
    let mut run = Command::new("unshare");
    run.args(["-rm", "sh", "-c", &script]);
    let run = match run.output() {
        Ok(run) if run.status.code() != Some(77) => run,
        _ => return skipped(TEST, "no namespaces or no tmpfs here"),
    };
    let said = String::from_utf8_lossy(&run.stderr);
    if said.contains("unshare failed") || said.contains("Operation not permitted") {
        return skipped(TEST, "no namespaces here");
    }
    assert_eq!(run.status.code(), Some(3), "{said}");
    assert!(said.contains("recording pauses"), "{said}");
    assert!(said.contains("recording continues"), "{said}");
    let summary: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    for name in ["ingest", "twin", "detect"] {
        assert_eq!(stage(&summary, name)["dropped"], 0, "{summary}");
    }
    assert_eq!(stage(&summary, "record")["restarts"], 0, "{summary}");
    assert!(
        stage(&summary, "record")["dropped"].as_u64() > Some(0),
        "{summary}"
    );
    // Every closed file is complete, and there are at least two.
    let whole: Vec<u64> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|kind| kind == "mcap"))
        .map(|path| joint_states(&path))
        .collect();
    assert!(whole.len() >= 2, "{whole:?} {said}");
}

#[test]
fn a_folder_that_cannot_be_written_to_is_an_error_of_check() {
    let folder = tempfile::tempdir().unwrap();
    write(
        &folder.path().join("out"),
        "a file where a folder should be",
    );
    let file = pipeline(folder.path(), "4", "{mcap: out/below/a.mcap}");
    let checked = Out::answer([Path::new("check"), &file]);
    assert_eq!(checked.code, 2, "{}", checked.stdout);
    assert!(
        checked.stderr.contains("cannot write into"),
        "{}",
        checked.stderr
    );
    assert!(
        checked.stderr.contains("pipeline.yaml:7:"),
        "{}",
        checked.stderr
    );
}

#[test]
fn a_recorder_that_names_a_folder_or_no_place_for_files_is_an_error_of_check() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("there")).unwrap();
    for (record, said) in [
        ("{mcap: rec/}", "is a folder, no file"),
        ("{mcap: there}", "is a folder, no file"),
        ("{mcap: /dev/null/x.mcap}", "cannot write into /dev/null"),
        ("{mcap: /proc/nope/x.mcap}", "cannot write into /proc/nope"),
    ] {
        let file = pipeline(folder.path(), "4", record);
        let checked = Out::answer([Path::new("check"), &file]);
        assert_eq!(checked.code, 2, "{record}: {}", checked.stdout);
        assert!(
            checked.stderr.contains(said),
            "{record}: {}",
            checked.stderr
        );
        let place = "pipeline.yaml:7:";
        assert!(checked.stderr.contains(place), "{}", checked.stderr);
    }
}
