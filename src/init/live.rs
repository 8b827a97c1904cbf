//! Recordings of the live robot, in place of existing ones.

use std::path::{Path, PathBuf};
use std::time::Duration;

use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::report::Problem;

use super::folder::{Folder, quoted};
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::plan;
use crate::supervisor::{self, Care, Verbosity};

/// Number of recordings that are made. One in four is held out, as when the user gives five.
const RECORDINGS: f64 = 5.0;
/// Longest time for which the recorder continues after the end \[s\]. The length of a piece allows for it, so that no
/// sixth piece begins.
/// Physical: a stage receives the request to end within a second, even on a busy machine.
const RUN_ON_S: f64 = 1.0;
/// Fraction of its planned length below which a piece is left out: it holds too little motion.
/// Physical: an interrupted stream leaves a fragment; half a piece still holds a motion.
const LEAST_SHARE: f64 = 0.5;
/// Shortest recording time that is accepted \[s\].
const SHORTEST_S: f64 = 10.0;
/// Time without joint states after which the command fails; by then the source has reported the reason.
const EXPECT_DATA: Duration = Duration::from_secs(15);

/// A live source, and its recording time.
#[derive(Debug)]
pub struct Live<'a> {
    /// Recording time \[s\].
    pub seconds: f64,
    /// The settings of the source, as in a pipeline's `ingest`.
    pub source: &'a str,
    /// The URDF.
    pub robot: &'a Path,
}

impl Live<'_> {
    /// Records the robot and returns the recordings. The pipeline file of the recorder stays in the folder.
    ///
    /// # Errors
    /// If the source's settings are wrong, no data arrives, data is lost, or the command is interrupted.
    pub fn record(&self, folder: &Folder, out: &mut Output) -> Result<Vec<PathBuf>, Failure> {
        if self.seconds.is_nan() || self.seconds < SHORTEST_S {
            let title = format!("{} s are too short to learn from", self.seconds);
            let help = format!("give {SHORTEST_S} s or more; a minute or two are a good start");
            return Err(Failure::Rejected(Problem::new(title).help(help).into()));
        }
        let recordings = folder.recordings();
        if let Some(old) = of_folder(&recordings).first() {
            let title = format!("{} is there already", old.display());
            let help = "move the recordings of an earlier start away, or give them as RECORDING in place of --live";
            return Err(Failure::Rejected(Problem::new(title).help(help).into()));
        }
        let file = folder.recorder();
        super::write(&file, self.pipeline(folder).as_bytes())?;
        let pipeline = Pipeline::load(&file, None)?;
        let links = plan::links(&pipeline);
        let care = Care {
            expect_data: Some(EXPECT_DATA),
            for_data: Some(Duration::from_secs_f64(self.seconds)),
            verbosity: Verbosity::Normal,
        };
        out.say(&format!(
            "recording for {} s: move the robot through different motions, and let nothing touch it",
            self.seconds
        ));
        let hold = interrupt::hold();
        let summary = supervisor::run(&pipeline, &links, None, care)?;
        if interrupt::is_asked() {
            let there = format!(
                "while recording; {} holds what there is",
                recordings.display()
            );
            return Err(Failure::Interrupted(there));
        }
        drop(hold);
        match summary.exit() {
            Exit::Done => self.long_enough(of_folder(&recordings), out),
            exit => {
                out.print(&summary.table())?;
                let lost = exit == Exit::Lossy;
                let why = if lost {
                    "samples were lost"
                } else {
                    "the recording failed"
                };
                Err(Failure::Failed(anyhow::anyhow!(
                    "{why}; nothing was learnt"
                )))
            }
        }
    }

    /// Returns the recordings that are long enough to learn from; the others stay in the folder and are reported.
    fn long_enough(&self, all: Vec<PathBuf>, out: &mut Output) -> Result<Vec<PathBuf>, Failure> {
        let least_s = LEAST_SHARE * self.seconds / RECORDINGS;
        let mut kept = Vec::new();
        for path in all {
            let recording = tauscope_session::open(&path);
            let recording = recording.map_err(|error| Failure::rejected(error.to_string()))?;
            let span = recording.start_ns().zip(recording.end_ns());
            let lasts_s = span.map_or(0.0, |(start, end)| (end - start) as f64 * 1e-9);
            if lasts_s < least_s {
                let path = path.display();
                out.say(&format!(
                    "note: {path} lasts only {lasts_s:.1} s and is left out"
                ));
            } else {
                kept.push(path);
            }
        }
        Ok(kept)
    }

    fn pipeline(&self, folder: &Folder) -> String {
        let absolute = std::path::absolute(self.robot);
        let robot = absolute.as_deref().unwrap_or(self.robot).display();
        let files = folder.seen_from(&folder.recordings().join("{n}.mcap"));
        RECORDER
            .replace("ROBOT", &quoted(&robot.to_string()))
            .replace("SOURCE", self.source)
            .replace("FILES", &quoted(&files))
            .replace("SECONDS", &format!("{:.1}", self.piece_s()))
    }

    /// Returns the length of a piece \[s\].
    fn piece_s(&self) -> f64 {
        // The last piece is the shortest: it ends when the recording time is over.
        (self.seconds + RUN_ON_S) / RECORDINGS
    }
}

/// Returns the recordings in a folder; none if there is no folder.
fn of_folder(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut recordings: Vec<PathBuf> = paths
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "mcap")
        })
        .collect();
    recordings.sort();
    recordings
}

const RECORDER: &str = r"# Written by `tauscope init --live`: records the robot, and nothing else. `tauscope run` runs it again.
version: 1

cells:
  # Recorded in the source's unit; `init` determines it afterwards.
  arm: {robot: ROBOT, effort_unit: A}

stages:
  - name: ingest
    ingest: {SOURCE}

  - name: record
    inputs: [ingest]
    record: {mcap: FILES, split: {after_s: SECONDS}}
";

#[cfg(test)]
mod tests {
    use super::*;

    fn live(seconds: f64) -> Live<'static> {
        Live {
            seconds,
            source: "zenoh: {}",
            robot: Path::new("robot.urdf"),
        }
    }

    #[test]
    fn five_pieces_hold_all_that_is_recorded() {
        for seconds in [SHORTEST_S, 20.0, 75.0, 3600.0] {
            let pieces_s = RECORDINGS * live(seconds).piece_s();
            assert!(pieces_s >= seconds + RUN_ON_S - 1e-9, "{seconds}");
            let last_s = seconds - (RECORDINGS - 1.0) * live(seconds).piece_s();
            assert!(last_s > LEAST_SHARE * seconds / RECORDINGS, "{seconds}");
        }
    }

    #[test]
    fn a_rest_is_left_out_and_told() {
        let demo = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/demo.mcap");
        let mut out = Output::Memory(String::new(), String::new());
        let kept = live(60.0).long_enough(vec![demo.clone()], &mut out);
        assert_eq!(kept.unwrap(), std::slice::from_ref(&demo));
        let kept = live(6000.0).long_enough(vec![demo], &mut out);
        assert!(kept.unwrap().is_empty());
        assert!(matches!(out, Output::Memory(_, said) if said.contains("is left out")));
    }
}
