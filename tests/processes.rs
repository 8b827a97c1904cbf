//! Stages that share a process: same result as in separate processes, and the failure of one cell does not affect
//! others.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use crate::common::live::{Live, is_alive, signal, stage, wait_until};
use crate::common::{bundled, write};

/// The bundled recording at this rate, with `more` at the top level, through two detectors into a recorder.
fn pipeline(folder: &Path, rate: &str, more: &str) {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
{more}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: {rate}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: one, input: twin, detect: {{twin_regression: {{}}, threshold: {{score: 12}}}}}}
- {{name: two, input: twin, detect: {{momentum_observer: {{}}, threshold: {{score: 12}}}}}}
- {{name: record, inputs: [ingest, twin, one, two], record: {{mcap: out.mcap}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

/// Puts every stage into a process of its own.
fn apart(folder: &Path) {
    let file = folder.join("pipeline.yaml");
    let mut text = std::fs::read_to_string(&file).unwrap();
    for name in ["ingest", "twin", "one", "two"] {
        let alone = format!("{{name: {name}, process: {name},");
        text = text.replace(&format!("{{name: {name},"), &alone);
    }
    write(&file, &text);
}

/// Messages by topic: time and bytes. Health reports are left out, because they count samples in transit.
fn topics(archive: &Path) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let bytes = std::fs::read(archive).unwrap();
    let mut topics: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let one = (message.log_time, message.data.to_vec());
        topics
            .entry(message.channel.topic.clone())
            .or_default()
            .push(one);
    }
    for messages in topics.values_mut() {
        // Two detectors on one topic are in the order of arrival.
        messages.sort();
    }
    topics.retain(|topic, _| !topic.contains("health") && !topic.contains("diagnostics"));
    topics
}

fn links<'a>(summary: &'a serde_json::Value, over: &str) -> Vec<&'a serde_json::Value> {
    let links = summary["links"].as_array().unwrap().iter();
    links.filter(|link| link["over"] == over).collect()
}

#[test]
fn stages_give_the_same_in_one_process_as_apart() {
    let archives = [false, true].map(|is_apart| {
        let folder = tempfile::tempdir().unwrap();
        pipeline(folder.path(), "fast", "");
        if is_apart {
            apart(folder.path());
        }
        let (code, summary) = Live::start(folder.path(), &[]).end();
        assert_eq!(code, 0, "{summary}");
        let in_process = links(&summary, "in_process");
        assert_eq!(in_process.len(), if is_apart { 0 } else { 3 }, "{summary}");
        for link in summary["links"].as_array().unwrap() {
            assert_eq!(link["received"], link["emitted"], "{link}");
            assert!(link["received"].as_u64().unwrap() > 1_000, "{link}");
        }
        topics(&folder.path().join("out.mcap"))
    });
    let [joined, apart] = archives;
    assert!(joined.len() >= 5, "{:?}", joined.keys());
    assert_eq!(
        joined.keys().collect::<Vec<_>>(),
        apart.keys().collect::<Vec<_>>()
    );
    for (topic, messages) in &joined {
        assert!(apart[topic] == *messages, "{topic} differs");
    }
}

#[test]
fn a_killed_process_comes_back_with_all_its_stages() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "4", "");
    let mut live = Live::start(folder.path(), &[]);
    let recorder = live.wait_for_stage("record");
    let ids = ["two", "one", "twin", "ingest"].map(|name| live.wait_for_stage(name));
    assert!(ids.iter().all(|id| *id == ids[0] && *id != recorder));
    let part = folder.path().join("out.mcap.part");
    wait_until("samples flow", || {
        part.metadata().is_ok_and(|file| file.len() > 50_000)
    });
    signal(ids[0], "KILL");
    for name in ["ingest", "twin", "one", "two"] {
        live.wait_for(&format!(
            "warning: stage `{name}` was killed by signal 9: starting it again"
        ));
    }
    let again = live.wait_for_stage("ingest");
    assert!(again != ids[0] && is_alive(again) && is_alive(recorder));
    let (code, summary) = live.end();
    // Samples in transit from the process are lost with it, and the loss is reported.
    let count = |link: &serde_json::Value, key: &str| link[key].as_u64().unwrap();
    let mut lost = 0;
    for link in summary["links"].as_array().unwrap() {
        let got = count(link, "received") + count(link, "dropped");
        assert_eq!(count(link, "emitted"), got, "{summary}");
        lost += count(link, "dropped");
    }
    assert_eq!(code, if lost > 0 { 3 } else { 0 }, "{summary}");
    assert_eq!(stage(&summary, "ingest")["emitted"], 3001, "{summary}");
    for name in ["ingest", "twin", "one", "two"] {
        assert_eq!(stage(&summary, name)["restarts"], 1, "{name}: {summary}");
    }
    assert_eq!(stage(&summary, "record")["restarts"], 0, "{summary}");
}

/// Two cells in one process, one of which cannot write what it learns.
#[test]
fn a_cell_that_fails_leaves_the_others_of_its_process_alone() {
    let folder = tempfile::tempdir().unwrap();
    let data = bundled();
    let state = folder.path().join("no/such/folder/learnt.yaml");
    let cell = |name: &str, detect: &str| {
        format!(
            "- {{name: {name}_in, cell: {name}, ingest: {{file: {{path: {recording}}}, rate: 4}}}}
- {{name: {name}_twin, input: {name}_in, twin: {{}}}}
- {{name: {name}_detect, input: {name}_twin, detect: {{{detect}}}}}
",
            recording = data.join("demo.mcap").display()
        )
    };
    // Its file cannot be written: it fails after at most a minute of the stream, and at its end.
    let bias = "[1, 1, 1, 1, 1, 1, 1]";
    let bad = format!(
        "virtual_collision_sensor: {{bias: {bias}, learn: at_start, learning_s: 1, state: {}}}",
        state.display()
    );
    let text = format!(
        "version: 1
process: all
cells: {{good: {{robot: {robot}}}, bad: {{robot: {robot}}}}}
stages:
{}{}",
        cell("bad", &bad),
        cell("good", "twin_regression: {}, threshold: {score: 12}"),
        robot = data.join("demo_arm.urdf").display(),
    );
    write(&folder.path().join("pipeline.yaml"), &text);
    // A file in place of the folder.
    write(&folder.path().join("no"), "");
    let mut live = Live::start(folder.path(), &[]);
    let good = live.wait_for_stage("good_in");
    live.wait_for_part("stage `bad_detect` failed");
    assert!(is_alive(good), "the process went with the stage");
    let (_, summary) = live.end();
    let number = |name: &str, key: &str| stage(&summary, name)[key].as_u64().unwrap();
    for name in ["bad_in", "bad_twin", "bad_detect"] {
        assert!(
            number(name, "restarts") > 0 || stage(&summary, name)["failed"] == true,
            "{summary}"
        );
    }
    for name in ["good_in", "good_twin", "good_detect"] {
        assert_eq!(number(name, "restarts"), 0, "{summary}");
    }
    assert_eq!(
        number("good_detect", "received"),
        number("good_in", "emitted")
    );
}

#[test]
fn a_recorder_that_stands_still_delays_no_detection_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = format!(
        "version: 1
name: fast
robot: {}
rate_hz: 1000
recordings:
- {{name: loop, duration_s: 30, motion: {{fourier: {{period_s: 10, harmonics: 4, speed: 0.4, acceleration_rad_s2: 2.5, range: 0.5}}}}}}
",
        bundled().join("demo_arm.urdf").display()
    );
    write(&folder.path().join("scenario.yaml"), &scenario);
    pipeline(folder.path(), "realtime", "");
    let file = folder.path().join("pipeline.yaml");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once("file: {path: ").unwrap();
    let (_, after) = rest.split_once('}').unwrap();
    write(
        &file,
        &format!("{before}simulate: {{scenario: scenario.yaml}}{after}"),
    );
    let mut live = Live::start(folder.path(), &["--verbose"]);
    let recorder = live.wait_for_stage("record");
    let part = folder.path().join("out.mcap.part");
    wait_until("samples flow", || {
        part.metadata().is_ok_and(|file| file.len() > 20_000)
    });
    signal(recorder, "STOP");
    let before = received(&mut live, "two");
    std::thread::sleep(Duration::from_secs(8));
    // Older lines of the output must be read first.
    let mut during = received(&mut live, "two");
    for _ in 0..3 {
        during = received(&mut live, "two").max(during);
    }
    signal(recorder, "CONT");
    // More than the capacity of the link itself.
    assert!(during > before + 4_000, "{before}, then {during}");
    signal(live.id(), "INT");
    let (code, summary) = live.end();
    assert_eq!(code, 0, "{summary}");
    for link in summary["links"].as_array().unwrap() {
        assert_eq!(link["received"], link["emitted"], "{link}");
    }
}

/// Number of samples that a stage has received, from the next progress line:
/// `4 s: ingest 2000 (500 Hz, ...); twin ...`.
fn received(live: &mut Live, stage: &str) -> u64 {
    let line = live.wait_for_part(&format!("; {stage} "));
    let (_, rest) = line.split_once(&format!("; {stage} ")).unwrap();
    let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().unwrap()
}
