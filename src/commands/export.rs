//! `tauscope export`.

use std::path::{Path, PathBuf};

use tauscope_archive::whole_file::{self, Existing};
use tauscope_dynamics::Model;
use tauscope_explain::report::Report;
use tauscope_pipeline::report::Problem;
use tauscope_report::models::{self, Corrections, TARGETS, Target};
use tauscope_session::robot::{self, Robot, Source};
use tauscope_twin::TwinFile;

use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::output::Output;

/// Write the corrections of a report into a simulator's own file.
///
/// Corrections that the simulator's format cannot express are listed, also in the first lines of the file.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder that `explain` wrote.
    report: PathBuf,
    /// The simulator whose file is written.
    #[arg(long, value_name = "SIMULATOR", value_parser = target)]
    to: Target,
    /// The model to correct; everything else in it is kept. By default the robot that was explained; for `urdf` and
    /// `drake` a MuJoCo model is converted to a URDF.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// The new file.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
}

fn target(name: &str) -> Result<Target, String> {
    Target::named(name).ok_or_else(|| {
        let names = TARGETS.map(Target::name).join(", ");
        format!("there is no simulator `{name}`; there are {names}")
    })
}

/// Writes the file.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let twin_path = args.report.join("twin.yaml");
    let text = std::fs::read_to_string(&twin_path).map_err(|error| {
        let title = format!(
            "{}: {error}. A report without a verdict has no corrections",
            twin_path.display()
        );
        Failure::rejected(title)
    })?;
    let twin: TwinFile = serde_saphyr::from_str(&text).map_err(|error| {
        Failure::Rejected(Problem::of_file(&twin_path, error.to_string()).into())
    })?;
    let report_path = args.report.join("report.json");
    let broken = |error: String| Failure::Rejected(Problem::of_file(&report_path, error).into());
    let text = std::fs::read_to_string(&report_path).map_err(|error| broken(error.to_string()))?;
    let report: Report = serde_json::from_str(&text).map_err(|error| broken(error.to_string()))?;
    refuse_unknown_scales(&twin)?;
    let explained = robot_of(&twin);
    let model_path = args.model.as_ref().or(explained.as_ref());
    let is_robot = args.to != Target::Sdf;
    let robot_path = if is_robot {
        model_path
    } else {
        explained.as_ref()
    };
    let Some(robot_path) = robot_path else {
        return Err(Failure::rejected(
            "the report does not say which robot it explains: give its file with --model FILE"
                .to_owned(),
        ));
    };
    let inputs = [Some(robot_path), args.model.as_ref()];
    args.force
        .check_beside([args.out.clone()], inputs.into_iter().flatten())?;
    let robot = robot::read(robot_path).map_err(|error| {
        Failure::Rejected(Problem::of_file(robot_path, error.to_string()).into())
    })?;
    let (source, model) = source(args, robot_path, &robot)?;
    let corrections = Corrections::of(&model, &twin.terms, &report.findings);
    let written = models::write(args.to, &source, &robot.urdf, &corrections)
        .map_err(|error| Failure::rejected(error.to_string()))?;
    whole_file::write(&args.out, written.text.as_bytes(), Existing::Replace).map_err(|error| {
        Failure::Rejected(Problem::of_file(&args.out, format!("cannot write: {error}")).into())
    })?;
    let mut lines: Vec<String> = written
        .written
        .iter()
        .map(|line| format!("written: {line}"))
        .collect();
    lines.extend(
        written
            .lost
            .iter()
            .map(|line| format!("not written, or only nearly: {line}")),
    );
    if lines.is_empty() {
        lines.push("nothing to correct: the model is written as it is".to_owned());
    }
    lines.push(format!("\nwrote {}", args.out.display()));
    out.print(&lines.join("\n"))?;
    Ok(Exit::Done)
}

/// Returns the path of the robot that a report explains, if the report has it.
fn robot_of(twin: &TwinFile) -> Option<PathBuf> {
    twin.provenance.get("robot").map(PathBuf::from)
}

/// Returns the text to correct, and the robot with the drives that this text states.
fn source(args: &Args, robot_path: &Path, robot: &Robot) -> Result<(String, Model), Failure> {
    let rejected =
        |path: &Path, error: String| Failure::Rejected(Problem::of_file(path, error).into());
    let own = robot.model.clone();
    if args.to == Target::IsaacLab {
        return Ok((String::new(), own));
    }
    if args.to == Target::Sdf {
        let Some(path) = &args.model else {
            return Err(Failure::rejected(
                "an SDF is corrected in place: give it with --model FILE".to_owned(),
            ));
        };
        let text =
            std::fs::read_to_string(path).map_err(|error| rejected(path, error.to_string()))?;
        return Ok((text, own));
    }
    let source = robot::source(robot_path);
    match source.map_err(|error| rejected(robot_path, error.to_string()))? {
        Source::Mjcf(text) if args.to == Target::Mjcf => Ok((text, own)),
        // The converted URDF states nothing of the drives yet.
        Source::Mjcf(_) => {
            robot::plain_urdf(&robot.urdf).map_err(|error| rejected(robot_path, error.to_string()))
        }
        // With plausible inertias in place of implausible ones, as in the twin.
        Source::Urdf(_) => Ok((robot.urdf.clone(), own)),
    }
}

/// Refuses a twin whose efforts are in a unit that no simulator has.
fn refuse_unknown_scales(twin: &TwinFile) -> Result<(), Failure> {
    let is_scaled =
        |joint: &tauscope_twin::JointCorrection| (joint.gain - 1.0).abs() > f64::EPSILON;
    if twin.effort_unit == "A" && twin.joints.values().any(is_scaled) {
        return Err(Failure::rejected(
            "the twin's efforts are in A, and simulators compute in N m: explain the recordings with --torque-constant for all joints"
                .to_owned(),
        ));
    }
    Ok(())
}
