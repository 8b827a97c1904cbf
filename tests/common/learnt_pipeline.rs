//! A pipeline from the results of `tauscope evaluate`: its `twin.yaml`, and each part of its `learnt.yaml` as a
//! stage.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::labelled_set::{Set, evaluate};
use crate::common::{Out, bundled, tauscope, write};

/// Inputs of a pipeline over the results of an evaluation.
pub struct LearntPipeline<'a> {
    /// The folder that `evaluate` wrote to.
    pub evaluated: &'a Path,
    pub robot: &'a Path,
    pub recording: &'a Path,
    /// Settings of the `twin` stage, in braces.
    pub twin: Option<&'a str>,
}

impl LearntPipeline<'_> {
    /// Writes `pipeline.yaml` into `folder`, with the contents of `learnt.yaml` changed by `change`.
    pub fn write(&self, folder: &Path, change: impl Fn(&str) -> String) -> PathBuf {
        let Self {
            robot, recording, ..
        } = self;
        let usual = format!("{{model: {}}}", self.evaluated.join("twin.yaml").display());
        let mut text = format!(
            "version: 1\ncells: {{demo: {{robot: {robot}}}}}\nstages:\n\
             - {{name: ingest, ingest: {{file: {{path: {recording}}}, rate: fast}}}}\n\
             - {{name: twin, input: ingest, twin: {twin}}}\n",
            robot = robot.display(),
            recording = recording.display(),
            twin = self.twin.unwrap_or(&usual),
        );
        let learnt = std::fs::read_to_string(self.evaluated.join("learnt.yaml")).unwrap();
        let mut names = vec!["ingest", "twin"];
        for line in learnt.lines() {
            if line.starts_with(' ') {
                text += &format!("  {}\n", change(line));
            } else {
                let name = line.trim_end_matches(':');
                text += &format!("- name: {name}\n  input: twin\n  detect:\n");
                names.push(name);
            }
        }
        let inputs = names.join(", ");
        text += &format!("- {{name: record, inputs: [{inputs}], record: {{mcap: run.mcap}}}}\n");
        write(&folder.join("pipeline.yaml"), &text)
    }
}

/// `tauscope replay --json` of `recording`.
pub fn replay(pipeline: &Path, recording: &Path, out: &Path) -> Out {
    let pipeline = [
        "replay".as_ref(),
        "--force".as_ref(),
        "--json".as_ref(),
        "--pipeline".as_ref(),
        pipeline.as_os_str(),
    ];
    let recording = [recording.as_os_str(), "--out".as_ref(), out.as_os_str()];
    Out::answer(pipeline.into_iter().chain(recording))
}

/// Detectors that learn.
pub const LEARNT: [&str; 4] = [
    "window_ocsvm",
    "virtual_collision_sensor_basic",
    "virtual_collision_sensor",
    "tauscope",
];

/// The bundled set, evaluated once.
fn evaluated() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let set = Set::default().write(folder.path());
        let detectors = LEARNT.join(",");
        let run = evaluate(&set, folder.path(), &["--detectors", &detectors]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        folder
    });
    folder.path()
}

/// A pipeline with these results, over another recording or for another robot.
pub fn pipeline<'a>(
    robot: &'a Path,
    recording: &'a Path,
    twin: Option<&'a str>,
) -> LearntPipeline<'a> {
    LearntPipeline {
        evaluated: evaluated(),
        robot,
        recording,
        twin,
    }
}

/// The bundled arm.
pub fn arm() -> PathBuf {
    bundled().join("demo_arm.urdf")
}

/// The bundled recording with contacts.
pub fn demo() -> PathBuf {
    bundled().join("demo.mcap")
}

/// `tauscope run --json`.
pub fn run(pipeline: &Path) -> Out {
    let mut command = tauscope();
    command.args(["run", "--json"]).arg(pipeline);
    Out::of(command)
}

/// Asserts exit code 2 and an error output that contains all of `said`.
pub fn refused(out: &Out, said: &[&str]) {
    assert_eq!(out.code, 2, "{}\n{}", out.stdout, out.stderr);
    for said in said {
        assert!(out.stderr.contains(said), "{said}: {}", out.stderr);
    }
}
