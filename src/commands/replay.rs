//! `tauscope replay`.

pub mod archive;
mod table;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use tauscope_archive::whole_file;
use tauscope_pipeline::parallel;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::recordings;
use tauscope_pipeline::replay::{Outcome, Replay, ReplayError, TwinChoice, stem};
use tauscope_pipeline::report::{Problem, Report, without_path};
use tauscope_pipeline::tables::{write_events, write_summary};
use tauscope_pipeline::tally::{Event, JointRms};

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet, Show};
use table::table;

/// Run a pipeline's stages over recordings, in process, as fast as the machine allows and with the same bytes every
/// time. The recordings replace the pipeline's own source.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    /// MCAP files, rosbag2 folders, `.db3` bags, ROS 1 bags, tables (`.csv`), or LeRobot data sets (`DATASET` for all
    /// of its episodes, `DATASET/episode_000003` for one).
    #[arg(required_unless_present = "manifest", conflicts_with = "manifest")]
    recordings: Vec<PathBuf>,
    /// Instead of recordings: a file of `tauscope manifest`. Each of its recordings becomes one Parquet file in
    /// --out, named by the hash of all that it depends on. Existing results are not computed again.
    #[arg(long, value_name = "FILE", requires = "out", conflicts_with_all = ["force", "source"])]
    manifest: Option<PathBuf>,
    /// The part of the manifest to work on: 0/16 to 15/16.
    #[arg(long, value_name = "INDEX/COUNT", requires = "manifest")]
    shard: Option<archive::Shard>,
    /// With --manifest: also a row for each sample that a detector judged.
    #[arg(long, requires = "manifest")]
    scores: bool,
    /// The pipeline file.
    #[arg(long, default_value = "pipeline.yaml")]
    pipeline: PathBuf,
    /// Folder for the results: an archive (and picture) per recording as the pipeline's recorder says,
    /// `summary.parquet` and `events.parquet` over all. Without it nothing is written. With --manifest, a folder or
    /// its URL: `cell=CELL/day=DAY/HASH.parquet` (docs/results.md).
    #[arg(long)]
    out: Option<PathBuf>,
    /// Number of recordings replayed in parallel.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    jobs: u16,
    /// The stage that the recordings replace, if the pipeline has several sources.
    #[arg(long)]
    source: Option<String>,
    /// For archives that already contain a twin's effort: recompute or keep it.
    #[arg(long, value_enum, default_value_t)]
    twin: TwinChoice,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

/// Checks all recordings before the first is replayed: results of some could be mistaken for results of all. Tables
/// are checked when they are read, because the pipeline file may declare their columns.
fn check_recordings(args: &Args) -> Result<(), Report> {
    let mut report = Report::default();
    let mut said = BTreeSet::new();
    let is_table = |path: &&PathBuf| path.extension().is_some_and(|ending| ending == "csv");
    for path in args.recordings.iter().filter(|path| !is_table(path)) {
        let comparable = tauscope_session::open(path).and_then(|it| it.check_comparable(&[]));
        if let Err(error) = comparable {
            let title = error.to_string();
            // All episodes of a data set have the same fault: report it once.
            if said.insert(title.clone()) {
                report.push(Problem::new(title));
            }
        }
    }
    report.into_result(())
}

/// Replays the recordings.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let recordings = recordings::expand(&args.recordings)?;
    let args = Args {
        recordings,
        ..args.clone()
    };
    of_each(&args, out)
}

/// Replays recordings; data sets have been expanded into episodes.
fn of_each(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let pipeline = Pipeline::load_to_replay(&args.pipeline)?;
    check_names(args)?;
    for warning in pipeline.warnings(None) {
        out.say(&format!("warning: {warning}"));
    }
    if let (Some(manifest), Some(folder)) = (&args.manifest, &args.out) {
        let job = archive::Job {
            manifest,
            shard: args.shard,
            out: &folder.to_string_lossy(),
            jobs: args.jobs,
            twin: args.twin,
            with_scores: args.scores,
            show: args.quiet.show(out),
            json: args.json,
        };
        return archive::run(&job, &pipeline, out);
    }
    let replay = archive::prepared(&pipeline, args.source.as_deref(), args.twin, args.jobs)?;
    for stage in replay.left_out() {
        out.say(&format!(
            "note: stage `{stage}` is a program of its own and not replayed; `tauscope run` runs it"
        ));
    }
    check_recordings(args)?;
    if let Some(folder) = &args.out {
        make_folder(&replay, args, folder)?;
    }
    let hold = interrupt::hold();
    let results = replay_all(&replay, args, args.quiet.show(out));
    let mut outcomes = Vec::new();
    let mut wrong = Vec::new();
    let (mut failed, mut interrupted) = (None, false);
    for (recording, result) in args.recordings.iter().zip(results) {
        match result {
            Ok(outcome) => outcomes.push(outcome),
            Err(ReplayError::Interrupted) => interrupted = true,
            Err(error) if error.is_input() => wrong.push((recording, error.to_string())),
            Err(error) => {
                let why = without_path(recording, error.to_string());
                out.say(&format!("error: {}: {why}", recording.display()));
                failed = Some(Exit::Failed);
            }
        }
    }
    if interrupted {
        whole_file::remove_unfinished();
    }
    if let Some(folder) = args
        .out
        .as_ref()
        .filter(|_| !(interrupted && outcomes.is_empty()))
    {
        write_summary(folder, &outcomes).context("the summary")?;
        write_events(folder, &outcomes).context("the events")?;
    }
    drop(hold);
    if args.json {
        let all: Vec<_> = outcomes.iter().map(Summary::of).collect();
        out.print(&serde_json::to_string_pretty(&all).context("the summary")?)?;
    } else if !outcomes.is_empty() {
        out.print(&table(&outcomes))?;
    }
    if interrupted {
        return Err(Failure::Interrupted(how_far(args, outcomes.len())));
    }
    let others = !outcomes.is_empty() || failed.is_some();
    let refused = tell_refused(wrong, others, out)?;
    let lossy = outcomes.iter().any(|outcome| outcome.lost > 0);
    Ok(Exit::from_loss(lossy)
        .and(refused)
        .and(failed.unwrap_or(Exit::Done)))
}

/// Creates the folder for the results, unless a file that must be kept would be replaced.
fn make_folder(replay: &Replay, args: &Args, folder: &Path) -> Result<(), Failure> {
    let of = |recording| replay.files(recording, folder);
    let tables = ["summary.parquet", "events.parquet"].map(|name| folder.join(name));
    let files = args.recordings.iter().flat_map(|recording| of(recording));
    let inputs = args.recordings.iter().chain([&args.pipeline]);
    args.force.check_beside(files.chain(tables), inputs)?;
    let is_of_archive =
        |entry: std::fs::DirEntry| entry.file_name().to_string_lossy().starts_with("cell=");
    if std::fs::read_dir(folder).is_ok_and(|all| all.flatten().any(is_of_archive)) {
        let problem = Problem::new(format!(
            "{} holds results of `replay --manifest`, which would no longer be one result",
            folder.display()
        ));
        return Err(Failure::Rejected(
            problem.help("give another folder with --out").into(),
        ));
    }
    std::fs::create_dir_all(folder)
        .map_err(|error| Failure::rejected(format!("cannot make {}: {error}", folder.display())))
}

/// Reports recordings that were rejected: as a failure if there are no `others`, else as errors in addition to their
/// results.
fn tell_refused(
    wrong: Vec<(&PathBuf, String)>,
    others: bool,
    out: &mut Output,
) -> Result<Exit, Report> {
    let mut report = Report::default();
    let mut exit = Exit::Done;
    for (recording, why) in wrong {
        if others {
            let why = without_path(recording, why);
            out.say(&format!("error: {}: {why}", recording.display()));
            exit = Exit::Rejected;
        } else {
            report.push(Problem::of_file(recording, why));
        }
    }
    report.into_result(exit)
}

fn how_far(args: &Args, done: usize) -> String {
    let all = args.recordings.len();
    let kept = match (&args.out, done) {
        (None, _) | (_, 0) => "no result was written".to_owned(),
        (Some(out), 1) => format!("its results are in {}", out.display()),
        (Some(out), _) => format!("the results of these are in {}", out.display()),
    };
    format!("after {done} of {all} recordings; {kept}")
}

/// Rejects recordings of the same name: their results would overwrite each other.
fn check_names(args: &Args) -> Result<(), Report> {
    let mut report = Report::default();
    for (index, recording) in args.recordings.iter().enumerate() {
        let same = |other: &&PathBuf| stem(other) == stem(recording);
        if let Some(first) = args.recordings[..index].iter().find(same) {
            let title = format!(
                "`{}` and `{}` would give results of one name, `{}`",
                first.display(),
                recording.display(),
                stem(recording)
            );
            report.push(
                Problem::new(title).help("replay them in two commands with two --out folders"),
            );
        }
    }
    report.into_result(())
}

/// Replays the recordings; returns their results in order, whatever the number of jobs.
fn replay_all(replay: &Replay<'_>, args: &Args, show: Show) -> Vec<Result<Outcome, ReplayError>> {
    let progress = Progress::new(args.recordings.len(), show);
    let recordings = args.recordings.iter().enumerate().collect();
    parallel::map(usize::from(args.jobs), recordings, |(index, recording)| {
        if interrupt::is_asked() {
            return Err(ReplayError::Interrupted);
        }
        let result = replay.run(recording, args.out.as_deref(), &mut |fraction| {
            progress.set(index, fraction);
            !interrupt::is_asked()
        });
        progress.set(index, 1.0);
        result
    })
}

/// Summary of a recording, as printed with `--json`.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    recording: &'a str,
    cell: &'a str,
    effort_unit: &'a str,
    duration_s: f64,
    lost: u64,
    joints: &'a [String],
    twins: Vec<TwinSummary<'a>>,
    detectors: Vec<DetectorSummary<'a>>,
    stages: &'a [tauscope_pipeline::replay::StageCounts],
    files: &'a [PathBuf],
    notes: &'a [String],
}

#[derive(Debug, Serialize)]
struct TwinSummary<'a> {
    stage: &'a str,
    samples: u64,
    moving_samples: u64,
    joints: Vec<JointRms>,
}

#[derive(Debug, Serialize)]
struct DetectorSummary<'a> {
    stage: &'a str,
    detector: &'a str,
    judged: u64,
    events: &'a [Event],
}

impl<'a> Summary<'a> {
    fn of(outcome: &'a Outcome) -> Self {
        Self {
            recording: &outcome.recording,
            cell: &outcome.cell,
            effort_unit: &outcome.effort_unit,
            duration_s: outcome.duration_s,
            lost: outcome.lost,
            joints: &outcome.joint_names,
            twins: (outcome.twins.iter())
                .map(|twin| TwinSummary {
                    stage: &twin.stage,
                    samples: twin.samples,
                    moving_samples: twin.moving_samples,
                    joints: twin.rms(),
                })
                .collect(),
            detectors: (outcome.detectors.iter())
                .map(|detector| DetectorSummary {
                    stage: &detector.stage,
                    detector: &detector.detector,
                    judged: detector.judged,
                    events: &detector.events,
                })
                .collect(),
            stages: &outcome.stages,
            files: &outcome.files,
            notes: &outcome.notes,
        }
    }
}
