//! The folder of a cell: which files it has, and the pipeline file in it.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tauscope_pipeline::cell::Cell;
use tauscope_pipeline::files::FileKind;
use tauscope_pipeline::report::Problem;
use tauscope_twin::TwinFile;

use super::write;
use crate::existing::Force;
use crate::exit::Failure;
use crate::interrupt::{self, Undo};

/// The folder and the names in it. Where it is not kept, what has come into it since is taken away, so that a failed
/// or interrupted attempt can be repeated.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    undo: Option<Undo>,
}

impl Folder {
    /// The folder at `path`, which is made. Files that `init` would replace are an error unless `force` allows it;
    /// `recordings` must not be among them.
    ///
    /// # Errors
    /// If it cannot be made, or holds a pipeline already.
    pub fn prepare(path: &Path, force: Force, recordings: &[PathBuf]) -> Result<Self, Failure> {
        let mut this = Self {
            path: path.to_owned(),
            undo: None,
        };
        let mine = [
            this.pipeline(),
            this.twin(),
            this.learnt(),
            this.robot(),
            this.set(),
            this.page(),
            this.explained().join("report.json"),
        ];
        force.check_beside(mine.clone(), recordings)?;
        let explained = this.explained();
        let made = mine.into_iter().take(6);
        let made = made.chain([this.schema(), explained, path.to_owned()]);
        let new = made.filter(|path| path.symlink_metadata().is_err());
        let (new, explained) = (new.collect::<Vec<_>>(), this.explained());
        this.undo = Some(interrupt::undo(move || take_away(&new, &explained)));
        std::fs::create_dir_all(path).map_err(|error| {
            let problem = Problem::of_file(path, format!("cannot make the folder: {error}"));
            Failure::Rejected(problem.into())
        })?;
        Ok(this)
    }

    /// All is written, and stays.
    pub fn keep(mut self) {
        if let Some(undo) = self.undo.take() {
            interrupt::keep(undo);
        }
    }

    /// A path as the files of the folder name it: what is in the folder moves with it.
    pub fn seen_from(&self, path: &Path) -> String {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let (path, folder) = (absolute(path), absolute(&self.path));
        let inside = path.strip_prefix(&folder).unwrap_or(&path);
        inside.display().to_string()
    }

    /// What `tauscope run` runs.
    pub fn pipeline(&self) -> PathBuf {
        self.path.join("pipeline.yaml")
    }

    /// The schema of the pipeline file, for editors.
    fn schema(&self) -> PathBuf {
        self.path.join("pipeline.schema.json")
    }

    /// The corrected twin.
    pub fn twin(&self) -> PathBuf {
        self.path.join("twin.yaml")
    }

    /// What the detector has learnt.
    pub fn learnt(&self) -> PathBuf {
        self.path.join("learnt.yaml")
    }

    /// A copy of the robot's URDF, so that the folder can be moved.
    pub fn robot(&self) -> PathBuf {
        self.path.join("robot.urdf")
    }

    /// The recordings as a set, to evaluate detectors on once some are labelled.
    pub fn set(&self) -> PathBuf {
        self.path.join("set.yaml")
    }

    /// The recordings that `--live` makes.
    pub fn recordings(&self) -> PathBuf {
        self.path.join("recordings")
    }

    /// The pipeline that makes them.
    pub fn recorder(&self) -> PathBuf {
        self.path.join("record.yaml")
    }

    /// What was found.
    pub fn page(&self) -> PathBuf {
        self.path.join("init.md")
    }

    /// The explanation of the twin.
    pub fn explained(&self) -> PathBuf {
        self.path.join("explained")
    }

    /// Writes the set: recordings that were fitted train, those held out validate.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_set(
        &self,
        cell: &Cell,
        state_topic: &str,
        fit: &[PathBuf],
        holdout: &[PathBuf],
    ) -> Result<(), Failure> {
        let mut text = format!(
            "# The contact-free recordings that `tauscope init` learnt from. Add labelled recordings under `test`, then\n\
             # `tauscope evaluate set.yaml --out results` compares detectors on them.\n\
             set: {}\nrobot: robot.urdf\neffort_unit: {}\ntopics: {{state: {}}}\n",
            quoted(&cell.facts.name),
            cell.facts.effort_unit.as_str(),
            quoted(state_topic)
        );
        for (key, recordings) in [("train", fit), ("validation", holdout)] {
            text.push_str(&format!("{key}:\n"));
            for recording in recordings {
                text.push_str(&format!("  - {}\n", quoted(&self.seen_from(recording))));
            }
        }
        write(&self.set(), text.as_bytes())
    }

    /// Writes the twin.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_twin(&self, twin: &TwinFile) -> Result<(), Failure> {
        let text = serde_saphyr::to_string(twin).context("the twin")?;
        write(&self.twin(), text.as_bytes())
    }

    /// Writes the pipeline file, and its schema. It listens to the `live` source; without one it plays `recording` until
    /// it is told to listen to the robot. `is_explained` says which twin it has.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_pipeline(
        &self,
        cell: &Cell,
        state_topic: &str,
        recording: &Path,
        live: Option<&str>,
        is_explained: bool,
    ) -> Result<(), Failure> {
        let schema = FileKind::Pipeline.schema_text();
        write(&self.schema(), schema.as_bytes())?;
        let source = live.map_or(RECORDED.to_owned(), |live| LIVE.replace("LIVE", live));
        let text = PIPELINE
            .replace("SOURCE", &source)
            .replace("CELL", &name(&cell.facts.name))
            .replace("UNIT", cell.facts.effort_unit.as_str())
            .replace("RECORDING", &quoted(&self.seen_from(recording)))
            .replace(
                "TWIN",
                if is_explained {
                    "The robot as `explain` corrected it: explained/report.html says how."
                } else {
                    "A gain and an offset per joint correct the URDF: init.md says why."
                },
            )
            .replace("TOPIC", &quoted(state_topic));
        write(&self.pipeline(), text.as_bytes())
    }
}

/// Removes what is `new`, folders behind what is in them. What is not there was not written.
fn take_away(new: &[PathBuf], explained: &Path) {
    for path in new {
        let _ = if path == explained {
            std::fs::remove_dir_all(path)
        } else if path.is_dir() {
            // One with recordings of `--live` in it stays.
            std::fs::remove_dir(path)
        } else {
            std::fs::remove_file(path)
        };
    }
}

/// A text as YAML holds any text.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A cell's name may have letters, digits, `-` and `_`.
fn name(robot: &str) -> String {
    let kept = |c: char| {
        if c.is_ascii_alphanumeric() || "-_".contains(c) {
            c
        } else {
            '_'
        }
    };
    let name: String = robot.chars().map(kept).collect();
    if name.is_empty() {
        "arm".to_owned()
    } else {
        name
    }
}

const PIPELINE: &str = r#"# yaml-language-server: $schema=pipeline.schema.json
# Written by `tauscope init`. Run it with `tauscope run pipeline.yaml`, replay recordings through it with
# `tauscope replay RECORDING... --pipeline pipeline.yaml --out results`, check it with `tauscope check pipeline.yaml`.
version: 1

cells:
  CELL:
    robot: robot.urdf
    effort_unit: UNIT

stages:
  - name: ingest
SOURCE

  - name: twin
    input: ingest
    # TWIN
    twin: {model: twin.yaml}

  - name: detect
    input: twin
    # What of the residual is usual was learnt from the recordings. Fewer false alarms need larger forces.
    detect: {tauscope: {learnt: learnt.yaml, false_alarms_per_hour: 5}}

  - name: watch
    input: twin
    # Says what has changed where no contact explains an alarm: a payload, friction, a scale or an offset.
    explain: {}

  - name: record
    inputs: [ingest, twin, detect, watch]
    record:
      # {n} is the first number that is free: nothing is replaced.
      mcap: "out/CELL-{n}.mcap"
      rerun: {file: "out/CELL-{n}.rrd"}
"#;

const RECORDED: &str = r#"    ingest:
      # A recording, as fast as it was recorded. `replay` puts its own recordings in its place.
      file: {path: RECORDING, topics: {state: TOPIC}}
      rate: 1
      # The robot itself, from ROS 2 with rmw_zenoh, in place of the line with `file`. docs/live.md has other ways.
      # zenoh: {connect: ["tcp/localhost:7447"], domain: 0, topics: {state: TOPIC}}"#;

const LIVE: &str = "    # The robot itself. `replay` puts its own recordings in its place.
    ingest: {LIVE}";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_spaces_becomes_one_that_a_cell_may_have() {
        assert_eq!(name("my robot/2"), "my_robot_2");
        assert_eq!(name(""), "arm");
    }

    #[test]
    fn a_path_with_quotes_stays_one_text() {
        assert_eq!(quoted(r#"a "b" \c"#), r#""a \"b\" \\c""#);
    }
}
