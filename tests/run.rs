//! `tauscope run`: stages as processes, their normal end, and the reports.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::path::Path;

use crate::common::live::{Live, is_alive, signal, stage, wait_until};
use crate::common::{Out, bundled, tauscope, write};

/// The bundled recording at this rate through all stages, into `out.mcap`.
fn pipeline(folder: &Path, rate: &str) {
    let data = bundled();
    let text = format!(
        "version: 1
cells: {{demo: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: {rate}}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- {{name: detect, input: twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: record, inputs: [ingest, twin, detect], record: {{mcap: out.mcap}}}}
",
        robot = data.join("demo_arm.urdf").display(),
        recording = data.join("demo.mcap").display(),
    );
    write(&folder.join("pipeline.yaml"), &text);
}

fn info(path: &Path) -> serde_json::Value {
    let mut command = tauscope();
    command.args(["info", "--json"]).arg(path);
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    serde_json::from_str(&out.stdout).unwrap()
}

fn count(info: &serde_json::Value, topic: &str) -> u64 {
    let topics = info["topics"].as_array().unwrap();
    topics.iter().find(|each| each["name"] == topic).unwrap()["message_count"]
        .as_u64()
        .unwrap()
}

#[test]
fn a_recording_goes_through_every_stage_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "fast");
    let (code, summary) = Live::start(folder.path(), &[]).end();
    assert_eq!(code, 0, "{summary}");
    let samples = count(&info(&bundled().join("demo.mcap")), "/joint_states");
    assert_eq!(stage(&summary, "ingest")["emitted"], samples);
    assert_eq!(stage(&summary, "detect")["received"], samples);
    assert_eq!(stage(&summary, "record")["received"], 3 * samples);
    for link in summary["links"].as_array().unwrap() {
        assert_eq!(link["received"], samples, "{link}");
        assert_eq!(link["dropped"], 0, "{link}");
    }
    let archive = info(&folder.path().join("out.mcap"));
    assert_eq!(count(&archive, "/joint_states"), samples);
    assert_eq!(count(&archive, "/twin/joint_states"), samples);
}

#[test]
fn a_run_does_not_replace_a_file_unless_it_is_forced_to() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "fast");
    let archive = folder.path().join("out.mcap");
    write(&archive, "somebody's only copy");
    let mut command = tauscope();
    command.current_dir(folder.path()).arg("run");
    let refused = Out::of(command);
    assert_eq!(refused.code, 2, "{}", refused.stderr);
    let expected = "`record` would replace ";
    assert!(refused.stderr.contains(expected), "{}", refused.stderr);
    assert!(refused.stderr.contains("--force"), "{}", refused.stderr);
    let kept = std::fs::read_to_string(&archive).unwrap();
    assert_eq!(kept, "somebody's only copy");

    let (code, summary) = Live::start(folder.path(), &["--force"]).end();
    assert_eq!(code, 0, "{summary}");
    assert!(count(&info(&archive), "/joint_states") > 0);
}

#[test]
fn a_name_with_a_number_is_new_with_every_run() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "fast");
    let file = folder.path().join("pipeline.yaml");
    let text = std::fs::read_to_string(&file).unwrap();
    write(
        &file,
        &text.replace("mcap: out.mcap", "mcap: \"out-{n}.mcap\""),
    );
    for n in 1..=2 {
        let (code, summary) = Live::start(folder.path(), &[]).end();
        assert_eq!(code, 0, "{summary}");
        let archive = folder.path().join(format!("out-00{n}.mcap"));
        let told = stage(&summary, "record")["files"][0].as_str().unwrap();
        assert!(archive.ends_with(told), "{told}");
        assert!(count(&info(&archive), "/joint_states") > 0);
    }
}

#[test]
fn two_cells_and_several_detectors_run_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let data = bundled();
    let robot = data.join("demo_arm.urdf").display().to_string();
    let cells = [("left", "demo.mcap"), ("right", "demo_validation.mcap")];
    let branches = cells.map(|(cell, recording)| {
        let path = data.join(recording);
        format!(
            "- {{name: {cell}_in, cell: {cell}, ingest: {{file: {{path: {path}}}, rate: fast}}}}
- {{name: {cell}_twin, input: {cell}_in, twin: {{}}}}
- {{name: {cell}_one, input: {cell}_twin, detect: {{naive_difference: {{}}, threshold: {{score: 1000}}}}}}
- {{name: {cell}_two, input: {cell}_twin, detect: {{twin_regression: {{}}, threshold: {{score: 1000}}}}}}
",
            path = path.display()
        )
    });
    let recorded = cells.map(|(cell, _)| format!("{cell}_in, {cell}_twin, {cell}_one, {cell}_two"));
    let text = format!(
        "version: 1
cells: {{left: {{robot: {robot}}}, right: {{robot: {robot}}}}}
stages:
{}- {{name: all, inputs: [{}], record: {{mcap: out.mcap}}}}
",
        branches.concat(),
        recorded.join(", ")
    );
    write(&folder.path().join("pipeline.yaml"), &text);
    let (code, summary) = Live::start(folder.path(), &[]).end();
    assert_eq!(code, 0, "{summary}");
    let archive = info(&folder.path().join("out.mcap"));
    for (cell, recording) in cells {
        let samples = count(&info(&data.join(recording)), "/joint_states");
        for stage in ["one", "two"] {
            assert_eq!(
                stage_of(&summary, cell, stage)["received"],
                samples,
                "{summary}"
            );
        }
        assert_eq!(count(&archive, &format!("/{cell}/joint_states")), samples);
    }
}

fn stage_of<'a>(summary: &'a serde_json::Value, cell: &str, name: &str) -> &'a serde_json::Value {
    stage(summary, &format!("{cell}_{name}"))
}

#[test]
fn a_second_interrupt_ends_everything_at_once() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "realtime");
    let mut text = std::fs::read_to_string(folder.path().join("pipeline.yaml")).unwrap();
    text += "- {name: deaf, outside: {command: [sleep, \"1000\"], output: joint_state}}\n";
    write(&folder.path().join("pipeline.yaml"), &text);
    let mut live = Live::start(folder.path(), &[]);
    let deaf = live.wait_for_stage("deaf");
    live.wait_for_stage("ingest");
    signal(live.id(), "INT");
    live.wait_for("ending the sources");
    signal(live.id(), "INT");
    live.wait_for("ending everything at once");
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert!(!is_alive(deaf));
}

#[test]
fn an_interrupt_ends_the_source_and_the_rest_finishes() {
    for name in ["INT", "TERM"] {
        let folder = tempfile::tempdir().unwrap();
        pipeline(folder.path(), "realtime");
        let mut live = Live::start(folder.path(), &[]);
        live.wait_for_stage("ingest");
        let part = folder.path().join("out.mcap.part");
        wait_until("the archive grows", || {
            part.metadata().is_ok_and(|file| file.len() > 20_000)
        });
        signal(live.id(), name);
        let (code, summary) = live.end();
        assert_eq!(code, 0, "{name}: {summary}");
        let samples = stage(&summary, "ingest")["emitted"].as_u64().unwrap();
        assert!(samples > 0);
        let archive = info(&folder.path().join("out.mcap"));
        assert_eq!(
            count(&archive, "/joint_states"),
            samples,
            "{name}: {summary}"
        );
        assert_eq!(
            count(&archive, "/twin/joint_states"),
            samples,
            "{name}: {summary}"
        );
    }
}

#[test]
fn nothing_outlives_a_supervisor_that_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "realtime");
    // A program that ignores everything, even the end of its standard input.
    let mut text = std::fs::read_to_string(folder.path().join("pipeline.yaml")).unwrap();
    text += "- {name: deaf, outside: {command: [sleep, \"1000\"], output: joint_state}}\n";
    write(&folder.path().join("pipeline.yaml"), &text);
    let mut live = Live::start(folder.path(), &[]);
    let stages: Vec<u32> = ["deaf", "record", "detect", "twin", "ingest"]
        .map(|stage| live.wait_for_stage(stage))
        .into();
    let part = folder.path().join("out.mcap.part");
    wait_until("the archive grows", || {
        part.metadata().is_ok_and(|file| file.len() > 20_000)
    });
    assert!(stages.iter().all(|&id| is_alive(id)));
    signal(live.id(), "KILL");
    assert_eq!(live.end().0, -1);
    wait_until("all stages have gone", || {
        !stages.iter().any(|&id| is_alive(id))
    });
    // The recording up to this point is complete.
    info(&folder.path().join("out.mcap"));
}

#[test]
fn a_stage_that_cannot_begin_fails_the_run() {
    let folder = tempfile::tempdir().unwrap();
    pipeline(folder.path(), "fast");
    let text = std::fs::read_to_string(folder.path().join("pipeline.yaml")).unwrap();
    // The file name is too long, which is detected only when the file is created.
    let name = format!("mcap: {}.mcap", "a".repeat(300));
    let text = text.replace("mcap: out.mcap", &name);
    write(&folder.path().join("pipeline.yaml"), &text);
    let mut live = Live::start(folder.path(), &[]);
    live.wait_for("error: stage `record` failed: ");
    let (code, summary) = live.end();
    assert_eq!(code, 1, "{summary}");
    assert_eq!(stage(&summary, "record")["failed"], true);
    assert_eq!(stage(&summary, "record")["restarts"], 0);
}
