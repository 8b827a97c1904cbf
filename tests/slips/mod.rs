//! Mistakes of a first day: a wrong file, a wrong name, a wrong unit. Each must end with the exit code in the README
//! and with a message that names the place, the cause and the remedy. None may give a silent zero or overwrite a
//! file. `tests/silence.rs` has those of a live run.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod arguments;
mod data_sets;
mod files;
mod recordings;
mod spoilt;

use std::path::{Path, PathBuf};

use crate::common::{Out, bundled};

/// A command line, and required parts of its output. `@name` is a file of the [`Desk`].
struct Slip {
    typed: &'static str,
    code: u8,
    says: &'static [&'static str],
}

/// A folder with files that are easily confused.
struct Desk {
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let this = Self { folder };
        for name in [
            "demo.mcap",
            "demo_validation.mcap",
            "demo_arm.urdf",
            "demo.twin.yaml",
        ] {
            std::fs::copy(bundled().join(name), this.path(name)).unwrap();
        }
        let demo = std::fs::read(this.path("demo.mcap")).unwrap();
        std::fs::write(this.path("torn.mcap"), &demo[..100_000]).unwrap();
        std::fs::write(this.path("stub.mcap"), &demo[..8]).unwrap();
        std::fs::write(this.path("empty.mcap"), "").unwrap();
        std::fs::write(this.path("words.mcap"), "hello\n").unwrap();
        std::fs::write(this.path("ros1.bag"), "#ROSBAG V2.0\n").unwrap();
        std::fs::write(this.path("table.csv"), "0,1\n1,2\n").unwrap();
        spoilt::write_all(this.folder.path());
        std::fs::create_dir(this.path("folder")).unwrap();
        this.data_sets();
        let other = std::fs::read_to_string(this.path("demo_arm.urdf")).unwrap();
        std::fs::write(this.path("other.urdf"), other.replace("\"joint", "\"axis_")).unwrap();
        std::fs::write(
            this.path("broken.urdf"),
            "<robot name=\"arm\"><link name=\"base\"></robot>",
        )
        .unwrap();
        std::fs::write(
            this.path("pipeline.yaml"),
            "version: 1
cells: {demo: {robot: demo_arm.urdf}}
stages:
- {name: ingest, ingest: {file: {path: demo.mcap}, rate: fast}}
- {name: twin, input: ingest, twin: {}}
- {name: detect, input: twin, detect: {naive_difference: {}, threshold: {score: 10}}}
- {name: record, inputs: [ingest, twin, detect], record: {mcap: \"out-{n}.mcap\"}}
",
        )
        .unwrap();
        let text = std::fs::read_to_string(this.path("pipeline.yaml")).unwrap();
        let text = |from: &str, to: &str| {
            assert!(text.contains(from));
            text.replace(from, to)
        };
        let moved = text("path: demo.mcap", "path: gone/far.mcap");
        let moved = moved.replace("out-{n}", "/proc/nowhere/out-{n}");
        std::fs::write(this.path("moved.yaml"), moved).unwrap();
        let cut = text("twin: {}", "twin: {effort_cutoff_hz: 80}");
        std::fs::write(this.path("cut.yaml"), cut).unwrap();
        let amperes = text("file: {path: demo.mcap}", "ur_rtde: {host: robot}");
        std::fs::write(this.path("rtde.yaml"), amperes).unwrap();
        this
    }

    /// LeRobot data sets: one with positions only, one with two episodes, and some that are broken.
    fn data_sets(&self) {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("archive/tests/data/lerobot");
        let mut files = Vec::new();
        walk(&from, &mut files);
        let copy = |set: &str, to: &str| {
            for (file, _) in &files {
                let Ok(below) = file.strip_prefix(from.join(set)) else {
                    continue;
                };
                let target = self.path(to).join(below);
                std::fs::create_dir_all(target.parent().unwrap()).unwrap();
                std::fs::copy(file, target).unwrap();
            }
        };
        for (set, to) in [
            ("so101", "so101"),
            ("aloha", "aloha"),
            ("openarm", "openarm"),
            ("aloha", "no_meta"),
            ("aloha", "torn"),
            ("so101", "unnamed"),
        ] {
            copy(set, to);
        }
        std::fs::remove_dir_all(self.path("no_meta/meta")).unwrap();
        let rows = self.path("torn/data/chunk-000/episode_000000.parquet");
        let whole = std::fs::read(&rows).unwrap();
        std::fs::write(&rows, &whole[..whole.len() / 2]).unwrap();
        let mut changed = whole;
        changed[300..340].fill(0xff);
        std::fs::write(rows.with_file_name("episode_000001.parquet"), changed).unwrap();
        std::fs::write(
            self.path("unnamed.columns.yaml"),
            "effort: {names: [observation.nothing]}\n",
        )
        .unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Files and folders with their lengths: a mistake must not change them.
    fn inventory(&self) -> Vec<(PathBuf, u64)> {
        let mut all = Vec::new();
        walk(self.folder.path(), &mut all);
        all.sort();
        all
    }

    fn answer(&self, typed: &str) -> Out {
        let words = typed.split_whitespace();
        let argument = |word: &str| match word.strip_prefix('@') {
            Some(name) => self.path(name).into_os_string(),
            None => word.into(),
        };
        Out::answer(words.map(argument).collect::<Vec<_>>())
    }
}

fn walk(folder: &Path, all: &mut Vec<(PathBuf, u64)>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        let path = entry.path();
        if path.is_dir() {
            walk(&path, all);
        } else {
            all.push((path, entry.metadata().unwrap().len()));
        }
    }
}

/// Runs all command lines in a fresh folder and reports those with another answer.
fn type_all(slips: &[Slip]) {
    let desk = Desk::new();
    let before = desk.inventory();
    let mut wrong = Vec::new();
    for slip in slips {
        let out = desk.answer(slip.typed);
        let said = format!("{}\n{}", out.stdout, out.stderr);
        let missing: Vec<&&str> = slip
            .says
            .iter()
            .filter(|words| !said.contains(**words))
            .collect();
        let doubled = doubled_path(&said);
        if out.code != i32::from(slip.code) || !missing.is_empty() || doubled.is_some() {
            wrong.push(format!(
                "tauscope {}: {} for {}, without {missing:?}, twice {doubled:?}\n{said}",
                slip.typed, out.code, slip.code
            ));
        }
        if slip.code == 2 {
            let after = desk.inventory();
            for (path, bytes) in &before {
                assert!(
                    after.contains(&(path.clone(), *bytes)),
                    "tauscope {} changed {}",
                    slip.typed,
                    path.display()
                );
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {}:\n{}",
        wrong.len(),
        slips.len(),
        wrong.join("\n")
    );
}

/// A path that occurs twice in a row in an error message.
fn doubled_path(said: &str) -> Option<&str> {
    said.lines().find(|line| {
        let mut parts = line.trim_start_matches("error: ").split(": ");
        let first = parts.next().filter(|part| part.contains('/'));
        first.is_some() && first == parts.next()
    })
}
