//! Replay of an archive, recording by recording: every runner gives the same files, and no recording is replayed
//! twice. Also the comparison of two results.
#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::common::{Out, bundled, root, tauscope, write};
use tauscope_pipeline::results::{COLUMNS, parquet_files, read_results};

const RECORDINGS: [&str; 4] = [
    "demo.mcap",
    "demo_train_points.mcap",
    "demo_train_sweep.mcap",
    "demo_validation.mcap",
];

/// Copies of the bundled recordings in `folder/archive`, and their manifest.
fn archive(folder: &Path) -> PathBuf {
    let archive = folder.join("archive");
    std::fs::create_dir(&archive).unwrap();
    for name in RECORDINGS {
        std::fs::copy(bundled().join(name), archive.join(name)).unwrap();
    }
    let manifest = folder.join("manifest.jsonl");
    let pattern = archive.join("*.mcap").into_os_string();
    let arguments = [
        "manifest".into(),
        pattern,
        "--out".into(),
        manifest.clone().into(),
    ];
    let out = Out::answer::<OsString>(arguments);
    assert_eq!(out.code, 0, "{}", out.stderr);
    manifest
}

/// A pipeline with this addition to its detector.
fn pipeline(folder: &Path, threshold: &str) -> PathBuf {
    for name in ["demo_arm.urdf", "demo.twin.yaml"] {
        std::fs::copy(bundled().join(name), folder.join(name)).unwrap();
    }
    let text = format!(
        "version: 1\ncells: {{demo: {{robot: demo_arm.urdf}}}}\nstages:\n\
         - {{name: ingest, ingest: {{file: {{path: archive/demo.mcap}}}}}}\n\
         - {{name: twin, input: ingest, twin: {{model: demo.twin.yaml}}}}\n\
         - {{name: contact, input: twin, detect: {{twin_regression: {{}}{threshold}}}}}\n"
    );
    let name = if threshold.is_empty() { "a" } else { "b" };
    write(&folder.join(format!("{name}.yaml")), &text)
}

fn replay(manifest: &Path, pipeline: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = tauscope();
    command.args(["replay", "--manifest"]).arg(manifest);
    command
        .arg("--pipeline")
        .arg(pipeline)
        .arg("--out")
        .arg(out);
    command.args(more);
    command
}

/// PATH with the folder of the program under test.
fn path_with_the_program() -> OsString {
    let programs = Path::new(env!("CARGO_BIN_EXE_tauscope")).parent().unwrap();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let all = std::iter::once(programs.to_owned()).chain(std::env::split_paths(&path));
    std::env::join_paths(all).unwrap()
}

/// Contents of all results by relative path.
fn contents(out: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let files = parquet_files(out).unwrap();
    let content = |path: PathBuf| {
        let bytes = std::fs::read(&path).unwrap();
        (path.strip_prefix(out).unwrap().to_owned(), bytes)
    };
    files.into_iter().map(content).collect()
}

#[test]
fn two_runners_of_which_one_is_killed_leave_the_same_files_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let pipeline = pipeline(folder.path(), "");
    let alone = folder.path().join("alone");
    let out = Out::of(replay(&manifest, &pipeline, &alone, &["--scores"]));
    assert_eq!(out.code, 0, "{}", out.stderr);
    assert_eq!(contents(&alone).len(), RECORDINGS.len());

    let together = folder.path().join("together");
    let start = || {
        replay(&manifest, &pipeline, &together, &["--scores"])
            .stdout(Stdio::null())
            .spawn()
            .unwrap()
    };
    let (mut killed, mut other) = (start(), start());
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(other.wait().unwrap().success());
    let out = Out::of(replay(
        &manifest,
        &pipeline,
        &together,
        &["--scores", "--json"],
    ));
    assert_eq!(out.code, 0, "{}", out.stderr);
    let summary: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    assert_eq!(summary["done_before"], RECORDINGS.len(), "{summary}");
    assert!(contents(&together) == contents(&alone));
    let unfinished = std::fs::read_dir(together.join("unfinished")).unwrap();
    assert_eq!(unfinished.count(), 0);
}

#[test]
fn shards_make_the_whole_and_what_failed_is_listed_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let pipeline = pipeline(folder.path(), "");
    // Replaces the recording by another one with the same name.
    let archive = folder.path().join("archive");
    std::fs::copy(
        archive.join("demo.mcap"),
        archive.join("demo_validation.mcap"),
    )
    .unwrap();
    let out = folder.path().join("out");
    let mut codes = Vec::new();
    for shard in ["0/3", "1/3", "2/3"] {
        let done = Out::of(replay(&manifest, &pipeline, &out, &["--shard", shard]));
        codes.push(done.code);
    }
    codes.sort_unstable();
    assert_eq!(codes, [0, 0, 1]);
    assert_eq!(contents(&out).len(), RECORDINGS.len() - 1);
    let lists = std::fs::read_dir(out.join("failed")).unwrap();
    let failed: String = lists
        .map(|list| std::fs::read_to_string(list.unwrap().path()).unwrap())
        .collect();
    assert_eq!(failed.lines().count(), 1, "{failed}");
    assert!(
        failed.contains("demo_validation") && failed.contains("has changed"),
        "{failed}"
    );
}

#[test]
fn a_result_tells_what_a_replay_tells_and_every_column_is_documented() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let pipeline = pipeline(folder.path(), "");
    let out = folder.path().join("out");
    let done = Out::of(replay(&manifest, &pipeline, &out, &[]));
    assert_eq!(done.code, 0, "{}", done.stderr);
    let results = read_results(&parquet_files(&out).unwrap()).unwrap();
    let demo = results
        .recordings
        .iter()
        .find(|r| r.recording == "demo")
        .unwrap();
    let mut command = tauscope();
    command
        .args(["replay", "--json", "--pipeline"])
        .arg(&pipeline);
    command.arg(bundled().join("demo.mcap"));
    let told: serde_json::Value = serde_json::from_str(&Out::of(command).stdout).unwrap();
    let told = told[0]["detectors"][0]["events"]
        .as_array()
        .unwrap()
        .clone();
    assert!(told.len() >= 5);
    let events: Vec<_> = results
        .events
        .iter()
        .filter(|e| e.sha256 == demo.sha256)
        .collect();
    assert_eq!(events.len(), told.len());
    for (event, told) in events.iter().zip(&told) {
        let t_s = (event.t_ns - demo.t_ns) as f64 * 1e-9;
        assert!(
            (t_s - told["t"].as_f64().unwrap()).abs() < 1e-9,
            "{event:?} {told}"
        );
        assert_eq!(event.link.as_deref(), told["link"].as_str());
        assert_eq!(serde_json::json!(event.joints), told["joints"]);
    }
    let page = std::fs::read_to_string(root().join("docs/results.md")).unwrap();
    for column in COLUMNS {
        assert!(page.contains(&format!("| `{column}` |")), "{column}");
    }
}

#[test]
fn a_higher_threshold_makes_contacts_vanish_and_the_comparison_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let a = pipeline(folder.path(), "");
    let b = pipeline(folder.path(), ", threshold: {score: 1.0e9}");
    let page = folder.path().join("diff.html");
    let mut command = tauscope();
    command.arg("diff").arg(&a).arg(&b);
    command.arg("--manifest").arg(&manifest);
    command.arg("--out").arg(folder.path().join("out"));
    command.arg("--json").arg("--html").arg(&page);
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}", out.stderr);
    let all: serde_json::Value = serde_json::from_str(&out.stdout).unwrap();
    let events = all["events_a"].as_u64().unwrap();
    assert!(events >= 5);
    assert_eq!(all["events_b"], 0, "{all}");
    assert_eq!(all["cells"]["demo"]["vanished"], events);
    let first = &all["differences"][0];
    assert_eq!(first["change"], "vanished");
    let window = first["window_ns"].as_array().unwrap();
    assert!(window[0].as_i64() < window[1].as_i64() && window[0].as_i64() > Some(0));
    assert!(std::fs::read_to_string(page).unwrap().contains("vanished"));

    let folders = ["a", "a"].map(|name| folder.path().join("out").join(name));
    let same = Out::answer(std::iter::once(OsString::from("diff")).chain(folders.map(Into::into)));
    assert_eq!(same.code, 0, "{}", same.stderr);
    assert!(
        same.stdout.contains("0 appeared, 0 vanished, 0 moved"),
        "{}",
        same.stdout
    );
    let said = "it is compared with itself, so that nothing can differ";
    assert!(same.stderr.contains(said), "{}", same.stderr);
    let above = folder.path().join("out");
    let above = Out::answer(["diff".into(), above.clone().into_os_string(), above.into()]);
    assert_eq!(above.code, 2);
    assert!(above.stderr.contains(said), "{}", above.stderr);
    let perhaps = format!(
        "perhaps: tauscope diff {0}/out/a {0}/out/b",
        folder.path().display()
    );
    assert!(above.stderr.contains(&perhaps), "{}", above.stderr);
    let words = Out::answer(["diff".into(), a.into_os_string(), b.into_os_string()]);
    assert_eq!(words.code, 2);
    assert!(words.stderr.contains("--manifest"), "{}", words.stderr);
}

#[test]
fn several_processes_on_one_machine_replay_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let pipeline = pipeline(folder.path(), "");
    let out = folder.path().join("out");
    let mut command = Command::new(root().join("deploy/archive/replay.sh"));
    command
        .arg(&manifest)
        .arg(&pipeline)
        .arg(&out)
        .args(["3", "2"]);
    command.env("PATH", path_with_the_program());
    let done = Out::of(command);
    assert_eq!(done.code, 0, "{}{}", done.stdout, done.stderr);
    assert_eq!(contents(&out).len(), RECORDINGS.len());
}

#[test]
fn the_command_line_of_the_cluster_jobs_is_one_that_the_program_takes() {
    let job = std::fs::read_to_string(root().join("deploy/archive/replay-job.yaml")).unwrap();
    let job: serde_json::Value = serde_saphyr::from_str(&job).unwrap();
    assert_eq!(job["spec"]["completionMode"], "Indexed");
    assert!(job["spec"]["backoffLimitPerIndex"].is_u64());
    let container = &job["spec"]["template"]["spec"]["containers"][0];
    assert_eq!(
        container["env"][0]["value"],
        job["spec"]["completions"].to_string()
    );
    let arguments = container["args"].as_array().unwrap().iter();
    let arguments: Vec<String> = arguments
        .map(|argument| {
            let argument = argument.as_str().unwrap();
            argument
                .replace("$(JOB_COMPLETION_INDEX)", "15")
                .replace("$(COUNT)", container["env"][0]["value"].as_str().unwrap())
        })
        .collect();
    // All arguments are valid except the files, so the errors must name these.
    let out = Out::answer(arguments);
    assert_eq!(out.code, 2);
    assert!(
        out.stderr.contains("/archive/pipeline.yaml"),
        "{}",
        out.stderr
    );

    let script = root().join("deploy/archive/replay.slurm");
    let folder = tempfile::tempdir().unwrap();
    let manifest = archive(folder.path());
    let pipeline = pipeline(folder.path(), "");
    let mut command = Command::new(script);
    command.args([&manifest, &pipeline, &folder.path().join("out")]);
    command.env("PATH", path_with_the_program());
    command.env("SLURM_ARRAY_TASK_ID", "0");
    command.env("SLURM_ARRAY_TASK_COUNT", "1");
    let done = Out::of(command);
    assert_eq!(done.code, 0, "{}{}", done.stdout, done.stderr);
}

/// The short form of `tests/archives/thousand.py`; the long one replays 1,000 recordings, and asks a cluster.
#[test]
fn an_archive_whose_runners_are_killed_and_meet_ends_with_the_same_files() {
    let test = "an_archive_whose_runners_are_killed_and_meet_ends_with_the_same_files";
    if Command::new("python3").arg("--version").output().is_err() {
        return crate::common::skipped(test, "python3 is absent");
    }
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new("python3");
    command.arg(root().join("tests/archives/thousand.py"));
    command
        .arg(env!("CARGO_BIN_EXE_tauscope"))
        .arg(folder.path());
    command.args(["--recordings", "24", "--seconds", "4"]);
    let out = Out::of(command);
    assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    let demands = out.stdout.lines().filter(|line| line.starts_with("ok  "));
    // The memory of a short-lived process may not have been sampled.
    assert!(demands.count() >= 12, "{}", out.stdout);
}
