//! `tauscope simulate`.

mod case;
mod set;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tauscope_archive::{Written, whole_file};
use tauscope_ingest::simulated::{self, Scenario, ScenarioError};
use tauscope_pipeline::provenance;
use tauscope_pipeline::scenario::ScenarioFacts;

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// Simulate recordings of a cell, with the physics and the contacts that a scenario specifies.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The scenario file.
    scenario: PathBuf,
    /// The folder for the recordings and `labels.json`; for a scenario with test recordings also the URDF and
    /// `set.yaml` to evaluate; for one that conceals the URDF, `case.yaml` to explain, and the answer in
    /// `concealed.json`.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
    /// Print the names of the files as JSON.
    #[arg(long)]
    json: bool,
}

/// Simulates the recordings and writes them.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let facts = ScenarioFacts::load(&args.scenario)?;
    let inputs = [&args.scenario, &facts.scenario.robot];
    args.force
        .check_beside(results(&facts, &args.out), inputs)?;
    let robot = facts.robot().context("cannot use the URDF")?;
    // The metadata of a recording must not reveal the concealed physics.
    let mut told = facts.scenario.clone();
    told.conceal = None;
    let scenario = serde_json::to_string(&told).context("cannot encode the scenario")?;
    let made_of = BTreeMap::from([
        ("tauscope".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("scenario".to_owned(), scenario),
        (
            "urdf_sha256".to_owned(),
            provenance::sha256(facts.urdf.as_bytes()),
        ),
    ]);
    let progress = Progress::new(1, args.quiet.show(out));
    let hold = interrupt::hold();
    let mut far = 0.0;
    let made = simulated::simulate(
        &robot.scenario,
        &robot.model,
        &args.out,
        &made_of,
        &mut |fraction| {
            progress.set(0, fraction);
            far = fraction;
            !interrupt::is_asked()
        },
    );
    drop(progress);
    let made = match made {
        Ok(Some(made)) => made,
        Ok(None) => {
            whole_file::remove_unfinished();
            return Err(Failure::Interrupted(how_far(args, &facts.scenario, far)));
        }
        Err(
            error @ (ScenarioError::Unstable { .. }
            | ScenarioError::Write(_)
            | ScenarioError::Labels { .. }),
        ) => return Err(Failure::Failed(error.into())),
        Err(error) => return Err(Failure::rejected(error.to_string())),
    };
    let case = match &made.concealed_path {
        Some(_) => Some(case::write(&facts, &args.out)?),
        None => None,
    };
    let set = set::write(&facts, &made.labels_path, &args.out)?;
    drop(hold);
    let text = if args.json {
        let recordings: Vec<_> = made
            .recordings
            .iter()
            .map(|each| each.path.clone())
            .collect();
        let value = serde_json::json!({
            "recordings": recordings,
            "labels": made.labels_path,
            "set": set,
            "case": case,
            "concealed": made.concealed_path,
        });
        serde_json::to_string_pretty(&value).context("cannot encode the result")?
    } else {
        let mut lines: Vec<String> = made.recordings.iter().map(line).collect();
        let others = [Some(made.labels_path), set, made.concealed_path, case];
        let others = others.into_iter().flatten();
        lines.extend(others.map(|path| path.display().to_string()));
        lines.join("\n")
    };
    out.print(&text)?;
    Ok(Exit::Done)
}

/// Returns the files that the command may write. An existing URDF with the same content is kept.
fn results(facts: &ScenarioFacts, out: &Path) -> Vec<PathBuf> {
    let recordings = facts.scenario.recordings.iter();
    let recordings = recordings.map(|recording| format!("{}.mcap", recording.name));
    let others = ["labels.json", "set.yaml", "case.yaml", "concealed.json"].map(str::to_owned);
    let mut files: Vec<PathBuf> = recordings
        .chain(others)
        .map(|name| out.join(name))
        .collect();
    let robot = out.join(case::robot_name(facts));
    if std::fs::read(&robot).is_ok_and(|there| there != facts.urdf.as_bytes()) {
        files.push(robot);
    }
    files
}

/// Describes how many recordings are complete once `share` of their total duration has been simulated.
fn how_far(args: &Args, scenario: &Scenario, share: f64) -> String {
    const ROUNDING: f64 = 1e-9;
    let lengths_s = || scenario.recordings.iter().map(|each| each.duration_s);
    let whole_s: f64 = lengths_s().sum();
    let mut end_s = 0.0;
    let ends = lengths_s().map(|length_s| {
        end_s += length_s;
        end_s / whole_s
    });
    let done = ends.filter(|end| *end <= share + ROUNDING).count();
    let kept = match done {
        0 => "nothing was written".to_owned(),
        _ => format!("these are in {}, without labels", args.out.display()),
    };
    format!(
        "after {done} of {} recordings; {kept}",
        scenario.recordings.len()
    )
}

fn line(written: &Written) -> String {
    let Written {
        path,
        messages,
        bytes,
    } = written;
    format!("{}: {messages} messages, {bytes} bytes", path.display())
}
