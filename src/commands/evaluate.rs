//! `tauscope evaluate`.

use std::path::PathBuf;

use anyhow::Context as _;
use serde::Serialize;
use tauscope_evaluate::{Evaluation, Judged, Options, Table};

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// Train, threshold and score detectors on a labelled set; print the papers' tables.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The set: robot, recordings, labels.
    #[arg(value_name = "SET")]
    set: PathBuf,
    /// The folder for events, scores, tables and the page.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Detectors, separated by commas, or `all`; by default those that suit the set.
    #[arg(long, value_name = "DETECTORS", value_delimiter = ',')]
    detectors: Vec<String>,
    /// Twin behind which the detectors run: `rigid`, `regression`, `topic`, or the path of a twin.yaml; may be given
    /// several times. By default `topic` where the set names one, `rigid` where it gives an impedance and efforts are
    /// in N m, else `regression`.
    #[arg(long, value_name = "TWIN")]
    twin: Vec<String>,
    /// Low-pass on the velocity before it is differentiated, in Hz; by default the twin's own.
    #[arg(long, value_name = "HZ", value_parser = cutoff)]
    velocity_cutoff_hz: Option<f64>,
    /// Low-pass on measured and expected effort, in Hz; by default the twin's own.
    #[arg(long, value_name = "HZ", value_parser = cutoff)]
    effort_cutoff_hz: Option<f64>,
    /// Number of detectors evaluated in parallel.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
    /// Print the results as JSON.
    #[arg(long)]
    json: bool,
}

fn cutoff(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=10_000.0).contains(&value) => Ok(value),
        _ => Err("it is a number from 0.01 to 10000".to_owned()),
    }
}

/// Evaluates the detectors and writes the results.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let options = Options {
        detectors: args.detectors.clone(),
        twins: args.twin.clone(),
        cutoffs_hz: [args.velocity_cutoff_hz, args.effort_cutoff_hz],
        jobs: usize::from(args.jobs),
    };
    let request = tauscope_evaluate::load(&args.set, &options)?;
    let recordings = request.recordings.iter();
    let twins = request.twins.iter();
    let inputs = (recordings.map(|recording| &recording.path))
        .chain(twins.filter_map(|twin| twin.path.as_ref()))
        .chain([&args.set]);
    let results = tauscope_evaluate::results(&args.out, &request);
    args.force.check_beside(results, inputs)?;
    tauscope_evaluate::prepare(&args.out)?;
    let progress = Progress::of_work(args.quiet.show(out));
    let result = tauscope_evaluate::run(request, &args.out, &|share, what| {
        progress.doing(share, what);
    });
    let evaluation = result.map_err(|error| {
        if error.is_input() {
            Failure::rejected(error.to_string())
        } else {
            // The error's text includes its causes.
            Failure::Failed(anyhow::Error::msg(error.to_string()))
        }
    })?;
    progress.doing(1.0, "writing");
    let judged = Judged::all(&evaluation);
    let tables = tauscope_evaluate::tables(&evaluation, &judged);
    let hold = interrupt::hold();
    let files = tauscope_evaluate::write(&args.out, &evaluation, &judged, &tables)?;
    drop(hold);
    drop(progress);
    if args.json {
        let summary = Summary::of(&evaluation, &judged, &tables, &files);
        out.print(&serde_json::to_string_pretty(&summary).context("the results")?)?;
    } else {
        out.print(&tauscope_evaluate::text(&tables, &evaluation.all_notes()))?;
        for file in &files {
            out.print(&format!("wrote {}", file.display()))?;
        }
    }
    Ok(Exit::from_loss(evaluation.lost > 0))
}

/// The results for `--json`.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    set: &'a str,
    lost: u64,
    notes: Vec<String>,
    detectors: Vec<Numbered<'a>>,
    tables: &'a [Table],
    files: &'a [PathBuf],
}

#[derive(Debug, Serialize)]
struct Numbered<'a> {
    detector: &'a str,
    twin: &'a str,
    threshold: f64,
    /// Scores over the labelled test recordings, by seed; `null` where nothing was scored.
    seeds: &'a [tauscope_evaluate::Numbers],
}

impl<'a> Summary<'a> {
    fn of(
        evaluation: &'a Evaluation,
        judged: &'a [Judged<'a>],
        tables: &'a [Table],
        files: &'a [PathBuf],
    ) -> Self {
        let detectors = judged.iter().map(|judged| Numbered {
            detector: judged.run.first().entry.name,
            twin: &evaluation.twins[judged.run.twin].name,
            threshold: judged.run.first().threshold,
            seeds: &judged.numbers,
        });
        Self {
            set: &evaluation.request.set.set,
            lost: evaluation.lost,
            notes: evaluation.all_notes(),
            detectors: detectors.collect(),
            tables,
            files,
        }
    }
}
