//! Stages in separate processes, and kill -9 of any of them: the supervisor reports it and restarts the stage within
//! a second, and the others continue.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;
use std::time::{Duration, Instant};

use crate::common::live::{Live, is_alive, signal, stage, wait_until};
use crate::common::{bundled, write};

const STAGES: [&str; 4] = ["record", "detect", "twin", "ingest"];

fn pipeline(folder: &Path) {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, process: ingest, ingest: {{file: {{path: {recording}}}, rate: 4}}}}
- {{name: twin, process: twin, input: ingest, twin: {{}}}}
- {{name: detect, process: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: record, inputs: [ingest, twin, detect], record: {{mcap: out.mcap}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

fn kill_and_watch(victim: &str) {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path());
    let mut live = Live::start(folder.path(), &[]);
    let ids = STAGES.map(|stage| live.wait_for_stage(stage));
    let part = folder.path().join("out.mcap.part");
    wait_until("samples flow", || {
        part.metadata().is_ok_and(|file| file.len() > 50_000)
    });

    let killed = ids[STAGES.iter().position(|&stage| stage == victim).unwrap()];
    let at = Instant::now();
    signal(killed, "KILL");
    live.wait_for(&format!(
        "warning: stage `{victim}` was killed by signal 9: starting it again"
    ));
    let again = live.wait_for_stage(victim);
    let took = at.elapsed();
    // On an idle machine within a second, which `tests/faults/faults.py` checks; here other tests run at the same
    // time.
    assert!(
        took < Duration::from_secs(10),
        "{victim} was back after {took:?}"
    );
    assert!(is_alive(again), "{victim}");
    for (other, id) in STAGES
        .iter()
        .zip(ids)
        .filter(|(other, _)| **other != victim)
    {
        assert!(is_alive(id), "{other} went with {victim}");
    }

    let (code, summary) = live.end();
    let restarts = |name: &str| stage(&summary, name)["restarts"].as_u64().unwrap();
    for name in STAGES {
        assert_eq!(
            restarts(name),
            u64::from(name == victim),
            "{name}: {summary}"
        );
        assert_eq!(stage(&summary, name)["failed"], false, "{name}: {summary}");
    }
    // A killed stage loses the samples in transit to it, a killed source those in transit from it. The loss is
    // reported.
    let dropped = stage(&summary, victim)["dropped"].as_u64().unwrap();
    assert!(victim == "ingest" || dropped > 0, "{victim}: {summary}");
    let lost = books_balance(&summary);
    assert_eq!(code, if lost > 0 { 3 } else { 0 }, "{victim}: {summary}");
    // A source continues at its last sample and repeats nothing.
    let whole = stage(&summary, "ingest")["emitted"].as_u64().unwrap();
    assert!((3_000..=3_001).contains(&whole), "{victim}: {summary}");
    let out = folder.path().join("out.mcap");
    assert!(
        out.exists() && !part.exists(),
        "{victim}: the archive is not whole"
    );
}

/// Asserts that on every link the emitted samples equal the received plus the dropped ones; returns the number
/// dropped in total.
fn books_balance(summary: &serde_json::Value) -> u64 {
    let mut lost = 0;
    for link in summary["links"].as_array().unwrap() {
        let count = |key: &str| link[key].as_u64().unwrap();
        assert_eq!(
            count("emitted"),
            count("received") + count("dropped"),
            "{link}"
        );
        assert_eq!(count("surplus"), 0, "{link}");
        lost += count("dropped");
    }
    lost
}

#[test]
fn a_killed_recorder_is_started_again() {
    kill_and_watch("record");
}

#[test]
fn a_killed_detector_is_started_again() {
    kill_and_watch("detect");
}

#[test]
fn a_killed_twin_is_started_again() {
    kill_and_watch("twin");
}

#[test]
fn a_killed_source_goes_on_where_it_was() {
    kill_and_watch("ingest");
}

#[test]
fn a_stage_that_keeps_dying_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path());
    let mut live = Live::start(folder.path(), &[]);
    for death in 1..=5 {
        let twin = live.wait_for_stage("twin");
        signal(twin, "KILL");
        let end = if death < 5 {
            "starting it again"
        } else {
            "and is not started again"
        };
        let start = if death < 5 { "warning" } else { "error" };
        let line = live.wait_for(&format!("{start}: stage `twin` was killed by signal 9"));
        assert!(line.contains(end), "death {death}: {line}");
    }
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert_eq!(stage(&summary, "twin")["failed"], true);
}

#[test]
fn what_a_killed_run_leaves_is_removed_by_the_next_one_and_what_lives_is_not() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path());
    let mut dead = Live::start(folder.path(), &[]);
    let ids = STAGES.map(|stage| dead.wait_for_stage(stage));
    let domain = |live: &Live| format!("t{:07x}", live.id());
    let left = |domain: &str| -> Vec<std::path::PathBuf> {
        let entries = ["/tmp", "/dev/shm"].map(|it| std::fs::read_dir(it).unwrap());
        let paths = entries.into_iter().flatten().map(|it| it.unwrap().path());
        paths
            .filter(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                name.trim_start_matches("tauscope_").starts_with(domain)
            })
            .collect()
    };
    let killed = domain(&dead);
    signal(dead.id(), "KILL");
    drop(dead);
    wait_until("its stages have gone", || {
        !ids.iter().any(|&id| is_alive(id))
    });
    assert!(left(&killed).len() > 1, "{:?}", left(&killed));
    // Simulates that a minute has passed.
    let folder_of = left(&killed)
        .into_iter()
        .find(|path| path.starts_with("/tmp"));
    let earlier = std::time::SystemTime::now() - Duration::from_mins(2);
    let opened = std::fs::File::open(folder_of.unwrap()).unwrap();
    opened.set_modified(earlier).unwrap();

    let other = tempfile::tempdir().unwrap();
    pipeline(other.path());
    let mut live = Live::start(other.path(), &[]);
    live.wait_for_stage("record");
    assert_eq!(left(&killed), Vec::<std::path::PathBuf>::new());
    let own = left(&domain(&live));
    tauscope_bus::link::remove_left_behind().unwrap();
    assert!(
        !own.is_empty() && own.iter().all(|path| path.exists()),
        "{own:?}"
    );
    assert_eq!(live.end().0, 0);
}
