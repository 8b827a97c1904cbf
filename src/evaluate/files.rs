//! What an evaluation leaves behind.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;

use super::judged::Judged;
use super::runner::{Output, Runner};
use super::tables::Table;
use super::{Evaluation, parquet};
use crate::exit::Failure;
use crate::explain::write_whole;
use crate::replay::Event;

/// One recording and detector, as the scorer reads it.
#[derive(Debug, Serialize)]
struct Detections<'a> {
    recording: &'a str,
    detector: &'a str,
    twin: &'a str,
    /// The table of scores beside the file.
    scores: &'a str,
    threshold: Option<f64>,
    events: &'a [Event],
}

/// Writes everything to `out`: by recording and detector the events and scores of the first seed, the tables
/// and the page. The results behind the first twin lie at the top, those behind another in a folder of its
/// name, there with `@` and the twin's name behind the detector's, so that one who reads all of them cannot
/// mistake one for the other.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    out: &Path,
    evaluation: &Evaluation,
    judged: &[Judged<'_>],
    _tables: &[Table],
) -> Result<Vec<PathBuf>, Failure> {
    for run in &evaluation.runs {
        let (runner, twin) = (run.first(), &evaluation.twins[run.twin].name);
        let (folder, detector) = if run.twin == 0 {
            (out.to_owned(), runner.entry.name.to_owned())
        } else {
            (out.join(twin), format!("{}@{twin}", runner.entry.name))
        };
        make(&folder)?;
        for output in &runner.outputs {
            write_output(&folder, &detector, twin, runner, output)?;
        }
    }
    parquet::write_results(&out.join("results.parquet"), evaluation).context("the results")?;
    parquet::write_events(&out.join("events.parquet"), judged).context("the events")?;
    let names = ["results.parquet", "events.parquet"];
    Ok(names.map(|name| out.join(name)).to_vec())
}

/// Makes a folder for results.
///
/// # Errors
/// If it cannot be made.
pub fn make(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::rejected(format!("cannot make {}: {error}", folder.display())))
}

fn write_output(
    folder: &Path,
    detector: &str,
    twin: &str,
    runner: &Runner,
    output: &Output,
) -> Result<(), Failure> {
    let stem = format!("{}.{}", output.recording, runner.entry.name);
    let scores = format!("{stem}.csv");
    let mut table = String::from("t,score\n");
    for (t, score) in output.t.iter().zip(&output.scores) {
        let _ = writeln!(table, "{t},{score}");
    }
    write_whole(&folder.join(&scores), table.as_bytes())?;
    let detections = Detections {
        recording: &output.recording,
        detector,
        twin,
        scores: &scores,
        threshold: Some(runner.threshold).filter(|threshold| threshold.is_finite()),
        events: &output.events,
    };
    let text = serde_json::to_string_pretty(&detections).context("the detections")?;
    write_whole(&folder.join(format!("{stem}.json")), text.as_bytes())
}
