//! A request for learning reaches the virtual collision sensor of a pipeline that runs, what it learns is there for the
//! next run, and the archive replays as the run went.

#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::path::{Path, PathBuf};

use crate::common::{Out, bundled, tauscope, write};

/// An arm at its cycle: somebody asks for learning in the first recording; in the second it is touched, less than the
/// first bias tells.
const SCENARIO: &str = "
seed: 11
rate_hz: 200
physics:
- {effect: coulomb_friction, joint: joint2, parameters: {coulomb_nm: 1.0}}
sensors: {effort_noise_nm: 0.05}
recordings:
- name: asked
  duration_s: 16
  learn_at_s: [3]
  motion: &cycle
    points: {through: [[0, 0.5, 0, 1.2, 0, 0.6, 0], [0.3, 0.7, 0, 1.0, 0, 0.6, 0]], speed: 0.5, rest_s: [0.2, 0.2]}
- name: touched
  duration_s: 8
  motion: *cycle
  contacts: [{link: link6, force_n: [0, 0, -25], t_on_s: 5.0, t_off_s: 5.4, rise_s: 0.03}]
";

struct Cell {
    folder: tempfile::TempDir,
    robot: PathBuf,
}

impl Cell {
    fn new() -> Self {
        let robot = bundled().join("demo_arm.urdf");
        let folder = tempfile::tempdir().unwrap();
        let scenario = format!(
            "version: 1\nname: cell\nrobot: {}{SCENARIO}",
            robot.display()
        );
        write(&folder.path().join("cell.yaml"), &scenario);
        Self { folder, robot }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A pipeline that plays one of the recordings live, into `<recording>.mcap`.
    fn pipeline(&self, recording: &str) -> PathBuf {
        let bias = (1..=7).map(|joint| format!("joint{joint}: 12"));
        let text = format!(
            "version: 1
cells: {{cell: {{robot: {robot}}}}}
stages:
- {{name: ingest, ingest: {{simulate: {{scenario: cell.yaml, recording: {recording}}}, rate: fast}}}}
- {{name: twin, input: ingest, twin: {{}}}}
- name: sensor
  input: twin
  detect: {{virtual_collision_sensor: {{bias: {{{bias}}}, learning_s: 8, state: learnt.yaml}}}}
- {{name: record, inputs: [ingest, twin, sensor], record: {{mcap: {recording}.mcap}}}}
",
            robot = self.robot.display(),
            bias = bias.collect::<Vec<_>>().join(", "),
        );
        write(&self.path(&format!("{recording}.yaml")), &text)
    }

    fn run(&self, recording: &str) {
        let mut command = tauscope();
        command
            .args(["run", "--force"])
            .arg(self.pipeline(recording));
        let out = Out::of(command);
        assert_eq!(out.code, 0, "{}{}", out.stdout, out.stderr);
    }

    fn learnt(&self) -> String {
        std::fs::read_to_string(self.path("learnt.yaml")).unwrap()
    }
}

/// The sensor's words in an archive, one after the other.
fn said(archive: &Path) -> Vec<Vec<u8>> {
    let recording = tauscope_archive::Recording::open(archive).unwrap();
    let mut messages = recording.messages(&["/detections"]).unwrap();
    let mut all = Vec::new();
    while let Some(message) = messages.next_message() {
        all.push(message.unwrap().body.to_vec());
    }
    all
}

fn alarms(archive: &Path) -> usize {
    let is_onset = |body: &&Vec<u8>| body.windows(5).any(|word| word == b"onset");
    said(archive).iter().filter(is_onset).count()
}

#[test]
fn a_request_reaches_the_running_sensor_and_what_it_learns_outlives_the_run() {
    let cell = Cell::new();
    assert!(!cell.path("learnt.yaml").exists());
    cell.run("asked");
    let words = said(&cell.path("asked.mcap"));
    let learns = |body: &Vec<u8>| body.windows(8).any(|word| word == b"learning");
    assert!(words.iter().any(learns), "it learnt while the pipeline ran");
    let learnt = cell.learnt();
    assert!(
        learnt.contains("joint2:") && learnt.contains("adapt_s:"),
        "{learnt}"
    );

    cell.run("touched");
    assert!(alarms(&cell.path("touched.mcap")) > 0, "{learnt}");
    assert_ne!(cell.learnt(), learnt, "it goes on adapting");

    std::fs::remove_file(cell.path("learnt.yaml")).unwrap();
    cell.run("touched");
    assert_eq!(
        alarms(&cell.path("touched.mcap")),
        0,
        "the first bias is too large for this contact"
    );
}

#[test]
fn the_archive_holds_the_request_and_replays_as_the_run_went() {
    let cell = Cell::new();
    cell.run("asked");
    // A replay begins with what the pipeline file says, whatever the state file holds.
    let mut command = tauscope();
    command
        .args(["replay", "--force", "--json", "--pipeline"])
        .arg(cell.path("asked.yaml"));
    command
        .arg(cell.path("asked.mcap"))
        .arg("--out")
        .arg(cell.path("replayed"));
    let replayed = Out::of(command);
    assert_eq!(replayed.code, 0, "{}", replayed.stderr);
    let live = said(&cell.path("asked.mcap"));
    assert!(!live.is_empty());
    assert_eq!(said(&cell.path("replayed/asked.mcap")), live);
}

#[test]
fn a_state_file_of_another_arm_is_refused_before_anything_runs() {
    let cell = Cell::new();
    cell.run("asked");
    let other = cell.learnt().replace("joint3:", "wrist:");
    write(&cell.path("learnt.yaml"), &other);
    let mut command = tauscope();
    command.arg("run").arg(cell.pipeline("touched"));
    let out = Out::of(command);
    assert_eq!(out.code, 2, "{}", out.stderr);
    for said in [
        "is of the joints joint1, joint2, joint4",
        "wrist",
        "touched.yaml",
    ] {
        assert!(out.stderr.contains(said), "{said}: {}", out.stderr);
    }
}
