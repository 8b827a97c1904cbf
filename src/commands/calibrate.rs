//! `tauscope calibrate`.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use comfy_table::{CellAlignment, Table, presets};
use tauscope_archive::ArchiveError;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_ingest::Topics;
use tauscope_pipeline::calibrate::{Calibrated, Job};
use tauscope_pipeline::cell::{Cell, ConstantSpot, EffortUnit};
use tauscope_pipeline::plausible::{cutoff_above_half, recorded_rate_hz};
use tauscope_pipeline::report::Problem;
use tauscope_pipeline::{provenance, recordings};
use tauscope_twin::{Expected, Motion, TwinFile};

use super::effort_unit;
use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::interrupt;
use crate::output::Output;
use crate::progress::{Progress, Quiet};

/// Fraction of the measured effort's variance explained by the model below which a gain is reported as unreliable.
const WEAK: f64 = 0.5;

/// Fit gain, offset and noise per joint to contact-free recordings, and measure the detectors' scores on them.
#[derive(Debug, Clone, clap::Args)]
pub struct Args {
    /// Contact-free recordings to which the gains are fitted.
    #[arg(required = true)]
    recordings: Vec<PathBuf>,
    /// The robot's URDF.
    #[arg(long, value_name = "URDF")]
    robot: PathBuf,
    /// File for the corrected twin.
    #[arg(long, default_value = "twin.yaml")]
    out: PathBuf,
    /// Contact-free recordings on which noise and scores, and so the detectors' thresholds, are measured; by default
    /// those of the fit, on which both come out too small.
    #[arg(long, value_name = "RECORDING", num_args = 1..)]
    validation: Vec<PathBuf>,
    /// Unit of the measured effort.
    #[arg(long, value_parser = effort_unit(), default_value_t)]
    effort_unit: EffortUnit,
    /// Torque constant of a joint in N m/A, for efforts in A; for all joints or for none.
    #[arg(long, value_name = "JOINT=CONSTANT", value_parser = joint_constant)]
    torque_constant: Vec<(String, f64)>,
    /// Topic of the measured joint states.
    #[arg(long, default_value = "/joint_states")]
    state_topic: String,
    /// Topic of the commanded motion, for `--motion commanded`.
    #[arg(long)]
    command_topic: Option<String>,
    /// Topic of an external twin's effort, which is corrected instead of the URDF's.
    #[arg(long)]
    twin_topic: Option<String>,
    /// The motion whose effort is computed.
    #[arg(long, default_value = "measured", value_parser = motion)]
    motion: Motion,
    /// Low-pass on the velocity before it is differentiated, in Hz.
    #[arg(long, default_value_t = tauscope_twin::Filters::default().velocity_cutoff_hz)]
    velocity_cutoff_hz: f64,
    /// Low-pass on measured and expected effort, in Hz; by default chosen per joint: 4.5, or higher where that adds
    /// no noise.
    #[arg(long)]
    effort_cutoff_hz: Option<f64>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    quiet: Quiet,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

pub(super) fn joint_constant(text: &str) -> Result<(String, f64), String> {
    let (joint, constant) = text.split_once('=').ok_or("give it as joint=constant")?;
    match constant.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok((joint.to_owned(), value)),
        _ => Err(format!("`{constant}` is no positive number")),
    }
}

fn motion(text: &str) -> Result<Motion, String> {
    match text {
        "measured" => Ok(Motion::Measured),
        "velocity_history" => Ok(Motion::VelocityHistory),
        "commanded" => Ok(Motion::Commanded),
        _ => Err("it is one of measured, velocity_history, commanded".to_owned()),
    }
}

/// Calibrates and writes the twin.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let args = &Args {
        recordings: recordings::expand(&args.recordings)?,
        validation: recordings::expand(&args.validation)?,
        ..args.clone()
    };
    let inputs = args.recordings.iter().chain(&args.validation);
    let inputs = inputs.chain([&args.robot]);
    args.force.check_beside([args.out.clone()], inputs)?;
    let constants = args.torque_constant.iter().cloned().collect();
    let problem = |_: ConstantSpot<'_>, title| Problem::new(title);
    let cell = Cell::from_urdf(&args.robot, args.effort_unit, &constants, &problem)?;
    let topics = Topics {
        state: args.state_topic.clone(),
        command: args.command_topic.clone(),
        twin: args.twin_topic.clone(),
        tool: None,
        learn: None,
        commands: None,
    };
    if args.motion == Motion::Commanded && args.command_topic.is_none() {
        return Err(Failure::rejected(
            "--motion commanded needs --command-topic",
        ));
    }
    check_cutoffs(args)?;
    let twin = tauscope_twin::Config {
        model: None,
        motion: args.motion,
        expected: if args.twin_topic.is_some() {
            Expected::Topic
        } else {
            Expected::Model
        },
        velocity_cutoff_hz: Some(args.velocity_cutoff_hz),
        effort_cutoff_hz: args.effort_cutoff_hz,
        ..tauscope_twin::Config::default()
    };
    let job = Job {
        cell: &cell,
        topics: &topics,
        twin: &twin,
        fit: &args.recordings,
        validation: &args.validation,
    };
    let progress = Progress::new(job.recordings(), args.quiet.show(out));
    let result = job.run(&|index, fraction| progress.set(index, fraction));
    drop(progress);
    let mut calibrated = result.map_err(|error| {
        if error.is_input() {
            Failure::rejected(error.to_string())
        } else {
            Failure::Failed(error.into())
        }
    })?;
    calibrated.file.provenance = provenance(args)?;
    let hold = interrupt::hold();
    write(&args.out, &calibrated.file)?;
    drop(hold);
    if args.json {
        out.print(&serde_json::to_string_pretty(&calibrated.file).context("the twin")?)?;
    } else {
        out.print(&report(&calibrated, &cell, args))?;
    }
    Ok(Exit::from_loss(calibrated.lost > 0))
}

/// Rejects a low-pass above half the sampling rate of a recording: it would pass everything, noise included.
fn check_cutoffs(args: &Args) -> Result<(), Failure> {
    let cutoffs = [
        ("--velocity-cutoff-hz", args.velocity_cutoff_hz),
        (
            "--effort-cutoff-hz",
            args.effort_cutoff_hz
                .unwrap_or(tauscope_twin::Filters::default().effort_cutoff_hz),
        ),
    ];
    for path in args.recordings.iter().chain(&args.validation) {
        let rejected = |error: ArchiveError| Failure::rejected(error.to_string());
        let recording = tauscope_session::open(path).map_err(rejected)?;
        let Some(rate_hz) = recorded_rate_hz(&recording, &args.state_topic).map_err(rejected)?
        else {
            continue;
        };
        for (name, cutoff_hz) in cutoffs {
            if let Some((title, help)) = cutoff_above_half(name, cutoff_hz, rate_hz) {
                let title = format!("{}: {title}", path.display());
                return Err(Failure::Rejected(Problem::new(title).help(help).into()));
            }
        }
    }
    Ok(())
}

/// Returns the program's version and the hashes of the inputs, by name.
fn provenance(args: &Args) -> anyhow::Result<std::collections::BTreeMap<String, String>> {
    let mut all = std::collections::BTreeMap::new();
    all.insert("tauscope".to_owned(), env!("CARGO_PKG_VERSION").to_owned());
    for (role, recordings) in [("fit", &args.recordings), ("validation", &args.validation)] {
        for recording in recordings {
            let name = recording
                .file_name()
                .unwrap_or(recording.as_os_str())
                .to_string_lossy();
            all.insert(
                format!("{role}/{name}"),
                provenance::sha256_of_file(recording)?,
            );
        }
    }
    Ok(all)
}

/// Writes the twin to `path`, whole or not at all.
fn write(path: &Path, file: &TwinFile) -> Result<(), Failure> {
    let text = serde_saphyr::to_string(file).context("the twin")?;
    whole_file::write(path, text, Existing::Replace).map_err(|error| {
        Failure::Rejected(Problem::of_file(path, format!("cannot write: {error}")).into())
    })
}

fn report(calibrated: &Calibrated, cell: &Cell, args: &Args) -> String {
    let unit = args.effort_unit.as_str();
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(
        ["joint", "gain", "offset", "noise", "explained", "low-pass"]
            .map(str::to_owned)
            .map(|name| match name.as_str() {
                "offset" | "noise" => format!("{name} [{unit}]"),
                "low-pass" => format!("{name} [Hz]"),
                _ => name,
            }),
    );
    let mut weak = Vec::new();
    for name in &cell.facts.joint_names {
        let joint = calibrated
            .file
            .joints
            .get(name)
            .copied()
            .unwrap_or_default();
        let explained = joint.explained.unwrap_or(0.0);
        if explained < WEAK {
            weak.push(name.as_str());
        }
        table.add_row([
            name.clone(),
            format!("{:.4}", joint.gain),
            format!("{:.4}", joint.offset),
            format!("{:.4}", joint.noise.unwrap_or(f64::NAN)),
            format!("{:.1} %", 100.0 * explained),
            format!(
                "{:.1}",
                joint
                    .effort_cutoff_hz
                    .unwrap_or(calibrated.file.filters.effort_cutoff_hz)
            ),
        ]);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let mut text = format!("{table}\n\nfitted on {} samples", calibrated.samples);
    if args.effort_unit == EffortUnit::Nm
        && args.twin_topic.is_none()
        && weak.len() == cell.facts.joint_names.len()
    {
        text.push_str(
            "\nnote: no joint's effort follows the robot's weight: if the driver publishes motor current, give \
             --effort-unit A",
        );
    }
    if !weak.is_empty() {
        text.push_str(&format!(
            "\nnote: the model explains less than {:.0} % of the effort of {}, so their gains are unreliable: friction or too little motion; record larger and faster motions",
            100.0 * WEAK,
            weak.join(", ")
        ));
    }
    for (name, score) in &calibrated.file.scores {
        text.push_str(&format!(
            "\n{name}: score {:.4} +- {:.4} on contact-free data",
            score.mean, score.standard_deviation
        ));
    }
    if args.validation.is_empty() {
        text.push_str("\nnote: noise and scores were measured on the recordings of the fit and are too small; give other recordings with --validation, or the thresholds will cause false alarms");
    }
    for note in cell.findings.iter().chain(&calibrated.notes) {
        text.push_str(&format!("\nwarning: {note}"));
    }
    if calibrated.lost > 0 {
        text.push_str(&format!(
            "\n{} samples of the recordings were lost",
            calibrated.lost
        ));
    }
    text.push_str(&format!("\nwrote {}", args.out.display()));
    text
}
