//! Tests of answers to queries, beyond those of the crates that the program builds on.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use arrow::array::AsArray as _;
use arrow::datatypes::Float64Type;
use arrow::ipc::reader::{FileReader, StreamReader};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use tauscope_archive::Recording;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::replay::{Replay, TwinChoice};
use tauscope_pipeline::results::{Folder, Identity, Unit, Wanted, parquet_files, read_results};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .unwrap()
        .to_owned()
}

fn data(name: &str) -> PathBuf {
    root().join("tests/data").join(name)
}

/// Runs the program in the folder of the repository.
fn ask(arguments: &[&str]) -> Output {
    let program = env!("CARGO_BIN_EXE_tauscope-query");
    Command::new(program)
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

/// The rows of an answer.
fn rows(sql: &str, paths: &[&str]) -> Vec<Value> {
    let answer = ask(&[&[sql, "--format", "json"], paths].concat());
    let text = String::from_utf8(answer.stdout).unwrap();
    assert!(
        answer.status.success(),
        "{sql}: {}",
        String::from_utf8_lossy(&answer.stderr)
    );
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// Error message of a wrong query.
fn wrong(arguments: &[&str]) -> String {
    let answer = ask(arguments);
    assert_eq!(answer.status.code(), Some(2), "{arguments:?}");
    String::from_utf8(answer.stderr).unwrap()
}

/// Results of `tauscope replay --manifest` for the recordings in the repository.
fn results() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(root().join("pipeline.yaml")).unwrap();
    let root = root().display().to_string();
    let path = folder.path().join("pipeline.yaml");
    std::fs::write(
        &path,
        text.replace(" tests/data", &format!(" {root}/tests/data")),
    )
    .unwrap();
    let pipeline = Pipeline::load(&path, None).unwrap();
    let replay = Replay::new(&pipeline, None, TwinChoice::Recompute).unwrap();
    let identity = Identity::of(&pipeline, TwinChoice::Recompute, false).unwrap();
    let shelf = Folder::open(&folder.path().join("results")).unwrap();
    let unit = Unit {
        replay: &replay,
        identity: &identity,
        shelf: &shelf,
        with_scores: false,
    };
    for name in ["demo.mcap", "demo_validation.mcap"] {
        unit.run(&Wanted::of(&data(name), None).unwrap(), &mut |_| true)
            .unwrap();
    }
    folder
}

#[test]
fn replay_in_a_query_gives_the_rows_that_replay_gives() {
    let folder = results();
    let path = folder.path().join("results").display().to_string();
    let pipeline = folder.path().join("pipeline.yaml").display().to_string();
    let order = "order by recording, row, stage, joint, t_ns";
    let kept = rows(&format!("select * from results {order}"), &[&path]);
    let pattern = format!("{}/tests/data/demo*.mcap", root().display());
    let sql = format!(
        "select * from replay('{pipeline}', '{pattern}') where recording in ('demo', 'demo_validation') {order}"
    );
    assert_eq!(rows(&sql, &[]), kept);
    // In another order of the columns, and only some.
    let some = rows("select t_ns, link from events order by t_ns", &[&path]);
    let sql = format!(
        "select t_ns, link from replay('{pipeline}', '{pattern}') where row = 'event' order by t_ns"
    );
    assert_eq!(rows(&sql, &[]), some);
    let files = parquet_files(&folder.path().join("results")).unwrap();
    let read = read_results(&files).unwrap();
    let told: Vec<_> = some
        .iter()
        .map(|row| (row["t_ns"].as_i64().unwrap(), row["link"].as_str()))
        .collect();
    let mut events: Vec<_> = read
        .events
        .iter()
        .map(|event| (event.t_ns, event.link.as_deref()))
        .collect();
    events.sort_unstable();
    assert!(!events.is_empty());
    assert_eq!(told, events);
}

#[test]
fn joints_are_the_joint_states_of_the_recording() {
    let recording = Recording::open(data("demo.mcap")).unwrap();
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut expected = Vec::new();
    while let Some(state) = states.next_state() {
        let (at, state) = state
            .map(|stamped| (stamped.log_time_ns, stamped.message))
            .unwrap();
        let joint = state.name.iter().position(|name| name == "joint3").unwrap();
        expected.push((at, state.effort[joint]));
    }
    let sql = "select log_ns, effort from joints where joint = 'joint3' and topic = '/joint_states' order by log_ns";
    let told: Vec<_> = (rows(sql, &["tests/data/demo.mcap"]).iter())
        .map(|row| {
            (
                row["log_ns"].as_i64().unwrap(),
                row["effort"].as_f64().unwrap(),
            )
        })
        .collect();
    assert_eq!(told, expected);
}

/// The counts of chunks that were read and skipped.
fn chunks(sql: &str, path: &str) -> (u64, u64) {
    let plan = ask(&[&format!("explain analyze {sql}"), path]);
    let plan = String::from_utf8(plan.stdout).unwrap();
    let count = |name: &str| {
        let (_, rest) = plan
            .split_once(&format!("{name}="))
            .unwrap_or_else(|| panic!("{name}: {plan}"));
        let digits: String = rest.chars().take_while(char::is_ascii_digit).collect();
        digits.parse().unwrap()
    };
    (count("chunks_read"), count("chunks_skipped"))
}

#[test]
fn only_the_chunks_of_the_time_and_the_topic_asked_for_are_read() {
    let path = "tests/data/demo.mcap";
    let recording = Recording::open(data("demo.mcap")).unwrap();
    let start_ns = recording.start_ns().unwrap();
    let (from, to) = (start_ns + 2_000_000_000, start_ns + 3_000_000_000);
    let all = chunks("select sum(effort) from joints", path);
    assert_eq!(all, (recording.chunks(), 0));
    let within = format!("log_ns between {from} and {to}");
    let (read, skipped) = chunks(
        &format!("select sum(effort) from joints where {within}"),
        path,
    );
    assert_eq!(read + skipped, recording.chunks());
    // One second of thirty, and the chunks at its edges.
    assert!(
        read >= 1 && read * 20 <= recording.chunks(),
        "{read} of {}",
        recording.chunks()
    );
    let of_another = "select sum(effort) from joints where topic = '/other'";
    assert_eq!(chunks(of_another, path), (0, recording.chunks()));
    // Skipping chunks does not change the answer.
    let counted = rows(
        &format!("select count(*) n, sum(effort) s from joints where {within}"),
        &[path],
    );
    let opaque = format!("log_ns + 0 between {from} and {to}");
    assert_eq!(
        counted,
        rows(
            &format!("select count(*) n, sum(effort) s from joints where {opaque}"),
            &[path]
        )
    );
    assert!(counted[0]["n"].as_u64().unwrap() > 0);
}

#[test]
fn recordings_that_are_not_asked_for_are_not_opened() {
    let sql = "explain analyze select count(*) from joints where recording = 'demo'";
    let plan = String::from_utf8(ask(&[sql, "tests/data/*.mcap"]).stdout).unwrap();
    assert!(
        plan.contains("recordings=1 of 4") && plan.contains("recordings_opened=1"),
        "{plan}"
    );
    assert!(
        rows(
            "select * from joints where recording = 'none'",
            &["tests/data/*.mcap"]
        )
        .is_empty()
    );
}

#[test]
fn the_answer_is_the_same_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let sql = "select joint, avg(effort) mean from joints group by joint order by joint";
    let path = "tests/data/demo.mcap";
    let means: Vec<f64> = rows(sql, &[path])
        .iter()
        .map(|row| row["mean"].as_f64().unwrap())
        .collect();
    assert_eq!(means.len(), 7);
    for format in ["parquet", "arrow"] {
        let out = folder.path().join(format);
        let arguments = [
            sql,
            path,
            "--format",
            format,
            "--out",
            out.to_str().unwrap(),
        ];
        assert!(ask(&arguments).status.success());
        let file = std::fs::File::open(&out).unwrap();
        let batches: Vec<_> = match format {
            "parquet" => ParquetRecordBatchReaderBuilder::try_new(file)
                .unwrap()
                .build()
                .unwrap()
                .collect(),
            _ => FileReader::try_new(file, None).unwrap().collect(),
        };
        let told: Vec<f64> = (batches.iter())
            .flat_map(|batch| {
                batch
                    .as_ref()
                    .unwrap()
                    .column(1)
                    .as_primitive::<Float64Type>()
                    .values()
                    .to_vec()
            })
            .collect();
        assert_eq!(told, means, "{format}");
        assert!(wrong(&arguments).contains("the file is there already"));
    }
    let stream = ask(&[sql, path, "--format", "arrow"]).stdout;
    let count: usize = StreamReader::try_new(&*stream, None)
        .unwrap()
        .map(|batch| batch.unwrap().num_rows())
        .sum();
    assert_eq!(count, 7);
}

#[test]
fn a_wrong_query_is_told_with_its_place_and_a_remedy() {
    let path = "tests/data/demo.mcap";
    for (sql, paths, said) in [
        (
            "select jont from joints",
            vec![path],
            ["1:8", "there is no column `jont`", "did you mean `joint`?"],
        ),
        (
            "select joint from joint",
            vec![path],
            [
                "1:19",
                "there is no table `joint`",
                "did you mean `joints`?",
            ],
        ),
        (
            "select * from events",
            vec![path],
            ["1:15", "there is no table `events`", "replay --manifest"],
        ),
        (
            "select * from joints",
            vec![],
            ["1:15", "there is no table `joints`", "name the recordings"],
        ),
        (
            "select *\nfrom joints wher a",
            vec![path],
            ["2:18", "Expected", "found: a"],
        ),
        (
            "select 1",
            vec!["none.mcap"],
            ["there is no file", "none.mcap", "behind the query"],
        ),
        (
            "select 1",
            vec!["tests/data"],
            ["tests/data", "holds no result", "'tests/data/*.mcap'"],
        ),
        (
            "select * from replay('pipeline.yaml')",
            vec![],
            ["replay takes", "a pipeline file", "recordings"],
        ),
        (
            "select * from replay('none.yaml', 'tests/data/demo.mcap')",
            vec![],
            ["none.yaml", "error", ""],
        ),
    ] {
        let text = wrong(&[&[sql], &paths[..]].concat());
        for part in said {
            assert!(text.contains(part), "{sql}: {part:?} is not in\n{text}");
        }
    }
}

#[test]
fn what_fails_on_the_way_names_the_file() {
    let answer = ask(&["select count(*) from joints", "README.md"]);
    let text = String::from_utf8(answer.stderr).unwrap();
    assert_eq!(answer.status.code(), Some(1));
    assert_eq!(text.matches("README.md").count(), 1, "{text}");
    assert!(text.contains("not a recording"), "{text}");
}

#[test]
fn a_torn_recording_is_read_up_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(data("demo.mcap")).unwrap();
    let path = folder.path().join("torn.mcap");
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let path = path.to_str().unwrap();
    let recordings = rows("select damages from recordings", &[path]);
    assert!(recordings[0]["damages"].as_u64().unwrap() > 0);
    let counted = |path| {
        rows("select count(*) n from joints", &[path])[0]["n"]
            .as_u64()
            .unwrap()
    };
    let (torn, whole) = (counted(path), counted("tests/data/demo.mcap"));
    assert!(torn > 0 && torn < whole, "{torn} of {whole}");
}
