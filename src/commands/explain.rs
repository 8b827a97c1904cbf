//! `tauscope explain`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use tauscope_pipeline::cell::EffortUnit;
use tauscope_pipeline::report::Problem;

use super::effort_unit;
use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::explain::{self, Arguments, Kept, Request};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// Fractions of the progress bar at which reading ends, and at which the engine ends.
const READ: f64 = 0.05;
const EXPLAINED: f64 = 0.95;

/// Identify the physics that the twin lacks, model it, and verify on held-out recordings that the error falls.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A case, which is a YAML file that names robot and recordings; or recordings to fit.
    #[arg(value_name = "CASE|RECORDING", required_unless_present = "fit")]
    inputs: Vec<PathBuf>,
    /// The folder for the report, the corrected twin and the predictions.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The robot's URDF.
    #[arg(long, value_name = "URDF")]
    robot: Option<PathBuf>,
    /// Recordings to fit, like those given without an option.
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    fit: Vec<PathBuf>,
    /// Recordings that are held out from the fit; by default some of those to fit.
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    holdout: Vec<PathBuf>,
    /// Unit of the measured effort; by default N m.
    #[arg(long, value_parser = effort_unit())]
    effort_unit: Option<EffortUnit>,
    /// Torque constant of a joint in N m/A, for efforts in A; for all joints or for none.
    #[arg(long, value_name = "JOINT=CONSTANT", value_parser = super::calibrate::joint_constant)]
    torque_constant: Vec<(String, f64)>,
    /// A corrected twin to start from; the findings are changes since then.
    #[arg(long, value_name = "TWIN")]
    twin: Option<PathBuf>,
    /// Topic of an external twin's effort, which replaces the URDF's.
    #[arg(long, value_name = "TOPIC")]
    twin_topic: Option<String>,
    /// Topic of the measured joint states; by default the one with efforts of most of the robot's joints.
    #[arg(long, value_name = "TOPIC")]
    state_topic: Option<String>,
    /// Topic of the commanded positions; the report then shows what the simulated arm does under these commands.
    #[arg(long, value_name = "TOPIC")]
    command_topic: Option<String>,
    /// An effect, or a fault of recordings such as `effort_unit`, that is excluded; may be given several times.
    #[arg(long, value_name = "EFFECT")]
    without: Vec<String>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
    /// Print the report as it is in `report.json`.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Returns the case, if one is named.
    ///
    /// # Errors
    /// An argument that conflicts with the case, which specifies it itself.
    fn case(&self) -> Result<Option<&Path>, Failure> {
        let is_case = |path: &PathBuf| {
            let extension = path.extension().and_then(OsStr::to_str);
            extension.is_some_and(|extension| matches!(extension, "yaml" | "yml"))
        };
        let Some(case) = self.inputs.iter().find(|path| is_case(path)) else {
            return Ok(None);
        };
        let beside = [
            ("--robot", self.robot.is_some()),
            ("--fit", !self.fit.is_empty()),
            ("--holdout", !self.holdout.is_empty()),
            ("--effort-unit", self.effort_unit.is_some()),
            ("--torque-constant", !self.torque_constant.is_empty()),
            ("--twin", self.twin.is_some()),
            ("--twin-topic", self.twin_topic.is_some()),
            ("--state-topic", self.state_topic.is_some()),
            ("--command-topic", self.command_topic.is_some()),
            ("another file", self.inputs.len() > 1),
        ];
        if let Some((what, _)) = beside.iter().find(|(_, given)| *given) {
            let title = format!(
                "{}: {what} goes with recordings, not with a case",
                case.display()
            );
            let help = "a case names robot and recordings itself: leave the rest out, or name the \
                        recordings in place of the case";
            return Err(Failure::Rejected(Problem::new(title).help(help).into()));
        }
        Ok(Some(case))
    }

    fn request(&self) -> Result<Request, Failure> {
        let without = explain::without(&self.without)?;
        if let Some(case) = self.case()? {
            return Ok(explain::from_case(case, without)?);
        }
        let fit: Vec<PathBuf> = self.inputs.iter().chain(&self.fit).cloned().collect();
        let arguments = Arguments {
            robot: self.robot.as_deref(),
            effort_unit: self.effort_unit.unwrap_or_default(),
            torque_constants_nm_per_a: self.torque_constant.iter().cloned().collect(),
            twin: self.twin.as_deref(),
            twin_topic: self.twin_topic.as_deref(),
            state_topic: self.state_topic.as_deref(),
            command_topic: self.command_topic.as_deref(),
            fit: &fit,
            holdout: &self.holdout,
        };
        Ok(explain::from_arguments(&arguments, without)?)
    }
}

/// Explains the recordings and writes the results.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let request = args.request()?;
    explain::refuse_to_replace(&args.out, &request, args.force)?;
    let progress = Progress::of_work(args.quiet.show(out));
    let input = explain::read(&request, &|share, what| progress.doing(READ * share, what))?;
    explain::make(&args.out)?;
    let kept = Kept::of(&input);
    let step = |share: f64, what: &str| progress.doing(READ + (EXPLAINED - READ) * share, what);
    let mut outcome = tauscope_explain::explain(input, &step)
        .map_err(|error| Failure::rejected(error.to_string()))?;
    progress.doing(EXPLAINED, "writing");
    let hold = interrupt::hold();
    let made = explain::write(&args.out, &request, &kept, &mut outcome)?;
    drop(hold);
    drop(progress);
    if args.json {
        out.print(&explain::json(&outcome)?)?;
    } else {
        out.print(&explain::text(&outcome.report, &made))?;
    }
    Ok(Exit::from_loss(kept.lost > 0))
}
