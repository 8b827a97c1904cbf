//! The folder of a cell: its files, and the content of its pipeline file.

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

/// The folder and the paths in it. Unless it is kept, files written since are removed, so that a failed or
/// interrupted attempt can be repeated.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    undo: Option<Undo>,
}

impl Folder {
    /// Creates the folder at `path`. Files that `init` would replace are an error unless `force` allows it;
    /// `recordings` must not be among them.
    ///
    /// # Errors
    /// If it cannot be created, or holds a pipeline already.
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

    /// Keeps the files: all are written.
    pub fn keep(mut self) {
        if let Some(undo) = self.undo.take() {
            interrupt::keep(undo);
        }
    }

    /// Returns a path for use in the files of the folder: relative if it is inside, so that the folder can be moved,
    /// else absolute.
    pub fn seen_from(&self, path: &Path) -> String {
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let (path, folder) = (absolute(path), absolute(&self.path));
        let inside = path.strip_prefix(&folder).unwrap_or(&path);
        inside.display().to_string()
    }

    /// Path of the pipeline file.
    pub fn pipeline(&self) -> PathBuf {
        self.path.join("pipeline.yaml")
    }

    /// Path of the schema of the pipeline file, for editors.
    fn schema(&self) -> PathBuf {
        self.path.join("pipeline.schema.json")
    }

    /// Path of the corrected twin.
    pub fn twin(&self) -> PathBuf {
        self.path.join("twin.yaml")
    }

    /// Path of the detector's trained settings.
    pub fn learnt(&self) -> PathBuf {
        self.path.join("learnt.yaml")
    }

    /// Path of a copy of the robot's URDF, so that the folder can be moved.
    pub fn robot(&self) -> PathBuf {
        self.path.join("robot.urdf")
    }

    /// Path of the set of recordings, to evaluate detectors once some are labelled.
    pub fn set(&self) -> PathBuf {
        self.path.join("set.yaml")
    }

    /// Path of the folder for the recordings of `--live`.
    pub fn recordings(&self) -> PathBuf {
        self.path.join("recordings")
    }

    /// Path of the pipeline file that records them.
    pub fn recorder(&self) -> PathBuf {
        self.path.join("record.yaml")
    }

    /// Path of the page of findings.
    pub fn page(&self) -> PathBuf {
        self.path.join("init.md")
    }

    /// Path of the folder with the explanation of the twin.
    pub fn explained(&self) -> PathBuf {
        self.path.join("explained")
    }

    /// Writes the set: fitted recordings are for training, held-out ones for validation.
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

    /// Writes the pipeline file and its schema. The pipeline listens to the `live` source; without one it plays
    /// `recording`, until the user connects it to the robot. `is_explained` selects the comment on its twin.
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

/// Removes the `new` files and folders, folders after their content. Errors are ignored: some may not have been
/// written.
fn take_away(new: &[PathBuf], explained: &Path) {
    for path in new {
        let _ = if path == explained {
            std::fs::remove_dir_all(path)
        } else if path.is_dir() {
            // A folder with recordings of `--live` is not empty, and stays.
            std::fs::remove_dir(path)
        } else {
            std::fs::remove_file(path)
        };
    }
}

/// Returns a text as a quoted YAML string.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Returns a valid cell name: letters, digits, `-` and `_` only.
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
    # The baseline of the residual was learnt from the recordings. Fewer false alarms need larger forces.
    detect: {tauscope: {learnt: learnt.yaml, false_alarms_per_hour: 5}}

  - name: watch
    input: twin
    # Reports a change of the arm if no contact explains an alarm: a payload, friction, a scale or an offset.
    watch: {}

  - name: record
    inputs: [ingest, twin, detect, watch]
    record:
      # {n} is the first free number: no file is replaced.
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
