//! Output files of an evaluation.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_detect::Config;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::tally::Event;
use tauscope_twin::ScoreStatistics;

use crate::evaluation::{Evaluation, Run};
use crate::input::Request;
use crate::judged::Judged;
use crate::recording::Role;
use crate::runner::{Output, Runner};
use crate::tables::Table;
use crate::twin::Prepared;
use crate::{html, parquet};

const PAGE: &str = "report.html";
const RESULTS: &str = "results.parquet";
const EVENTS: &str = "events.parquet";

/// Error while writing results.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// A file or folder that cannot be written.
    #[error(transparent)]
    Refused(#[from] Report),
    /// A result that cannot be encoded.
    #[error("{what}: {source}")]
    Failed {
        /// The result.
        what: &'static str,
        /// The cause.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

fn failed(
    what: &'static str,
    source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
) -> WriteError {
    let source = source.into();
    WriteError::Failed { what, source }
}

fn yaml(what: &'static str, value: &impl Serialize) -> Result<String, WriteError> {
    serde_saphyr::to_string(value).map_err(|error| failed(what, error))
}

fn write_whole(path: &Path, content: &[u8]) -> Result<(), WriteError> {
    whole_file::write(path, content, Existing::Replace).map_err(|error| {
        let problem = Problem::of_file(path, format!("cannot write: {error}"));
        WriteError::Refused(problem.into())
    })
}

/// Detections of one detector in one recording.
#[derive(Debug, Serialize)]
struct Detections<'a> {
    recording: &'a str,
    detector: &'a str,
    twin: &'a str,
    /// File name of the table of scores, in the same folder.
    scores: &'a str,
    threshold: Option<f64>,
    events: &'a [Event],
}

/// Writes all results to `out`: the events and scores of the first seed per recording and detector, the tables and
/// the page. Results behind the first twin are written to `out` itself, those behind another twin to a subfolder
/// of its name. There the detector's name is followed by `@` and the twin's name, so that the names stay unique.
///
/// # Errors
/// If a file cannot be written.
pub fn write(
    out: &Path,
    evaluation: &Evaluation,
    judged: &[Judged<'_>],
    tables: &[Table],
) -> Result<Vec<PathBuf>, WriteError> {
    for runner in evaluation.runs.iter().flat_map(|run| &run.seeds) {
        for (_, weights) in runner.config.clone().trained_files_mut() {
            whole_file::keep(weights);
        }
    }
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
    for (index, twin) in evaluation.twins.iter().enumerate() {
        let folder = if index == 0 {
            out.to_owned()
        } else {
            out.join(&twin.name)
        };
        let own = || evaluation.runs.iter().filter(move |run| run.twin == index);
        write_twin(&folder, twin, own().map(Run::first))?;
        let learnt: BTreeMap<&str, &Config> = own()
            .map(|run| (run.first().entry.name, &run.first().config))
            .collect();
        let text = yaml("what was learnt", &learnt)?;
        write_whole(&folder.join("learnt.yaml"), text.as_bytes())?;
    }
    parquet::write_results(&out.join(RESULTS), evaluation).map_err(|e| failed("the results", e))?;
    parquet::write_events(&out.join(EVENTS), judged).map_err(|e| failed("the events", e))?;
    let page = html::page(evaluation, judged, tables).map_err(|e| failed("the page", e))?;
    write_whole(&out.join(PAGE), page.as_bytes())?;
    Ok([PAGE, RESULTS, EVENTS].map(|name| out.join(name)).to_vec())
}

/// Writes the twin as a pipeline loads it, with the score statistics from which thresholds are set.
fn write_twin<'a>(
    folder: &Path,
    twin: &Prepared,
    runners: impl Iterator<Item = &'a Runner>,
) -> Result<(), WriteError> {
    let mut file = twin.file.clone();
    for runner in runners {
        let statistics = ScoreStatistics {
            mean: runner.statistics.mean,
            standard_deviation: runner.statistics.standard_deviation,
            samples: runner.counted,
        };
        file.scores.insert(runner.entry.name.to_owned(), statistics);
    }
    let text = yaml("the twin", &file)?;
    write_whole(&folder.join("twin.yaml"), text.as_bytes())
}

/// Returns the files that an evaluation into `out` writes.
pub fn results(out: &Path, request: &Request) -> Vec<PathBuf> {
    let mut files = [PAGE, RESULTS, EVENTS].map(|name| out.join(name)).to_vec();
    for (index, twin) in request.twins.iter().enumerate() {
        let folder = if index == 0 {
            out.to_owned()
        } else {
            out.join(&twin.name)
        };
        files.extend(["twin.yaml", "learnt.yaml"].map(|name| folder.join(name)));
        for recording in request
            .recordings
            .iter()
            .filter(|one| one.role != Role::Train)
        {
            for detector in &request.detectors {
                let stem = format!("{}.{}", recording.name, detector.name);
                files.extend(["csv", "json"].map(|ending| folder.join(format!("{stem}.{ending}"))));
            }
        }
    }
    files
}

/// Creates the folder for results.
///
/// # Errors
/// If it cannot be created.
pub fn prepare(out: &Path) -> Result<(), WriteError> {
    make(out)
}

fn make(folder: &Path) -> Result<(), WriteError> {
    whole_file::create_folder(folder).map_err(|error| {
        let title = format!("cannot make {}: {error}", folder.display());
        WriteError::Refused(Problem::new(title).into())
    })
}

fn write_output(
    folder: &Path,
    detector: &str,
    twin: &str,
    runner: &Runner,
    output: &Output,
) -> Result<(), WriteError> {
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
    let text =
        serde_json::to_string_pretty(&detections).map_err(|e| failed("the detections", e))?;
    write_whole(&folder.join(format!("{stem}.json")), text.as_bytes())
}
