//! `tauscope init`.

use std::path::{Path, PathBuf};

use tauscope_explain::report::Report;
use tauscope_pipeline::cell::EffortUnit;
use tauscope_pipeline::recordings;
use tauscope_pipeline::report::Problem;

use super::effort_unit;
use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::explain::{self, Named};
use crate::init::{self, Folder, Live, Looked, Seen, Told};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// Set up a cell from contact-free recordings: a pipeline with an explained twin and a trained detector.
///
/// Determines the unit of the effort, explains the physics that the robot's model lacks, trains the detector and
/// tests it on held-out recordings. Five recordings of different motions, a minute or more together, are a good
/// start; nothing may touch the robot in them.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings in which nothing touches the robot.
    #[arg(
        required_unless_present = "live",
        conflicts_with = "live",
        value_name = "RECORDING"
    )]
    recordings: Vec<PathBuf>,
    /// Record the running robot for this time instead, in five pieces. Let it move; nothing may touch it.
    #[arg(long, value_name = "SECONDS")]
    live: Option<f64>,
    /// The live source, as in the `ingest` of a pipeline file.
    #[arg(
        long,
        value_name = "YAML",
        requires = "live",
        default_value = "zenoh: {connect: [\"tcp/localhost:7447\"]}"
    )]
    source: String,
    /// The robot's URDF.
    #[arg(long, value_name = "URDF")]
    robot: PathBuf,
    /// The folder for pipeline.yaml, twin.yaml, learnt.yaml and the page of findings.
    #[arg(long, value_name = "DIR", default_value = "cell")]
    out: PathBuf,
    /// Unit of the measured effort; by default determined from the recordings.
    #[arg(long, value_parser = effort_unit())]
    effort_unit: Option<EffortUnit>,
    /// Topic of the measured joint states; by default the one with most of the robot's joints.
    #[arg(long, value_name = "TOPIC")]
    state_topic: Option<String>,
    /// An effect, or a fault of recordings such as `effort_unit`, that is excluded; may be given several times.
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
}

/// Fractions of the progress bar at which reading ends, and at which explaining ends.
const LOOKED: f64 = 0.05;
const EXPLAINED: f64 = 0.75;

/// Sets up the cell.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let folder = Folder::prepare(&args.out, args.force, &args.recordings)?;
    let recordings = match args.live {
        None => recordings::expand(&args.recordings)?,
        Some(seconds) => {
            let (source, robot) = (&args.source, &args.robot);
            let live = Live {
                seconds,
                source,
                robot,
            };
            live.record(&folder, out)?
        }
    };
    let progress = Progress::of_work(args.quiet.show(out));
    progress.doing(0.0, "looking at the recordings");
    let told = Told {
        robot: &args.robot,
        recordings: &recordings,
        state_topic: args.state_topic.as_deref(),
        effort_unit: args.effort_unit,
        without: &explain::without(&args.without)?,
    };
    let looked = told.look(&|share, what| progress.doing(LOOKED * share, what))?;
    let sentences = [looked.of_robot.clone(), looked.of_recordings.clone()].concat();
    match set_up(args, &folder, looked, progress) {
        Ok((page, exit)) => {
            folder.keep();
            out.print(&page)?;
            out.print(&format!("wrote {}", args.out.display()))?;
            Ok(exit)
        }
        Err(failure) => {
            // The page would contain them, but is not written.
            for sentence in &sentences {
                out.say(sentence);
            }
            Err(failure)
        }
    }
}

/// Returns the problem that lists the faults of the recordings: uncorrected, no twin fits them.
fn mended(report: &Report) -> Problem {
    let (mut faults, mut kinds) = (Vec::new(), Vec::new());
    for finding in report.mended() {
        faults.push(&*finding.sentence);
        let option = format!("--without {}", finding.known_as());
        if !kinds.contains(&option) {
            kinds.push(option);
        }
    }
    let problem = Problem::new(format!(
        "the recordings do not match the robot. {}",
        faults.join(" ")
    ));
    problem.help(format!(
        "mend this, or leave it out if it is wrong: {}",
        kinds.join(" ")
    ))
}

/// Explains the twin, trains the detector and writes the folder; returns the text of the page.
fn set_up(
    args: &Args,
    folder: &Folder,
    looked: Looked,
    progress: Progress,
) -> Result<(String, Exit), Failure> {
    let Looked {
        mut request,
        input,
        kept,
        of_robot,
        of_recordings,
        no_line,
    } = looked;
    explain::refuse_to_replace(&folder.explained(), &request, args.force)?;
    explain::make(&folder.explained())?;
    let step = |share: f64, what: &str| progress.doing(LOOKED + (EXPLAINED - LOOKED) * share, what);
    let mut outcome = tauscope_explain::explain(input, &step)
        .map_err(|error| Failure::rejected(error.to_string()))?;
    if let Some(reason) = &outcome.report.reason {
        let problem = Problem::new(format!("the recordings cannot be explained: {reason}"));
        return Err(Failure::Rejected(problem.into()));
    }
    if no_line.is_some() && !outcome.report.hands_out_twin() {
        return Err(Failure::Rejected(mended(&outcome.report).into()));
    }
    request.cell.facts.effort_unit = unit_of(&outcome.report);
    let hold = interrupt::hold();
    explain::write(&folder.explained(), &request, &kept, &mut outcome)?;

    let cell = &request.cell;
    let urdf = cell.facts.urdf.as_deref().unwrap_or_default();
    init::write(&folder.robot(), urdf.as_bytes())?;
    let paths = |of: &[Named]| -> Vec<PathBuf> { of.iter().map(|it| it.path.clone()).collect() };
    let (fit, holdout) = (paths(&request.fit), paths(&request.holdout));
    folder.write_set(cell, &request.state_topic, &fit, &holdout)?;
    if interrupt::is_asked() {
        let far = "before the detector learnt; what was written is removed";
        return Err(Failure::Interrupted(far.to_owned()));
    }
    drop(hold);
    let explained = folder.explained().join("twin.yaml");
    let explained = (outcome.report.hands_out_twin()).then_some(&*explained);
    let learnt = init::learn(
        &folder.set(),
        (explained, no_line.is_none()),
        cell.model.as_ref(),
        &folder.learnt(),
        &|share, what| {
            progress.doing(EXPLAINED + (1.0 - EXPLAINED) * share, what);
        },
    )?;
    let hold = interrupt::hold();
    folder.write_twin(&learnt.twin)?;
    let shown = holdout
        .first()
        .or(fit.first())
        .map_or(Path::new(""), PathBuf::as_path);
    let live = args.live.is_some().then_some(&*args.source);
    let is_explained = learnt.is_explained;
    folder.write_pipeline(cell, &request.state_topic, shown, live, is_explained)?;
    let seen = Seen {
        cell,
        of_robot: &of_robot,
        of_recordings: &of_recordings,
        lost: kept.lost,
        is_live: live.is_some(),
    };
    let page = init::page(folder, &seen, &outcome.report, &learnt);
    init::write(&folder.page(), page.as_bytes())?;
    drop(hold);
    drop(progress);
    Ok((page, Exit::from_loss(kept.lost > 0)))
}

/// Returns the unit that the explanation has determined.
fn unit_of(report: &Report) -> EffortUnit {
    if report.effort_unit == EffortUnit::A.as_str() {
        EffortUnit::A
    } else {
        EffortUnit::Nm
    }
}
