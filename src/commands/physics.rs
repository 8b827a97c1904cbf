//! `tauscope physics`.

use std::path::{Path, PathBuf};

use tauscope_fleet::physics::Row;
use tauscope_pipeline::cell::EffortUnit;
use tauscope_pipeline::pipeline::Pipeline;
use tauscope_pipeline::pipeline::stages::twin::TwinSettings;
use tauscope_pipeline::report::Problem;

use super::effort_unit;
use crate::existing::Force;
use crate::exit::{Exit, Failure};
use crate::explain::{Arguments, Request, from_arguments};
use crate::interrupt;
use crate::output::Output;
use crate::physics::{self, Choice, LONGEST_S, Night};

/// Measure an arm's friction, gain, offset, payload and backlash, with intervals, to follow them over weeks.
///
/// Run it every night. It adds a table to a folder: `cell=CELL/date=DATE/physics-TIME.parquet`. `tauscope weeks` and
/// `tauscope fleet --physics` report changes.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings in which little touches the robot, or the folder that the recorder writes to.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// The folder for the tables of all cells.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The pipeline file of the cell: its robot, its unit, its twin.
    #[arg(
        long,
        value_name = "PIPELINE",
        required_unless_present = "robot",
        conflicts_with = "robot"
    )]
    pipeline: Option<PathBuf>,
    /// The robot's URDF, without a pipeline file.
    #[arg(long, value_name = "URDF")]
    robot: Option<PathBuf>,
    /// The twin to compare with, for example yesterday's; by default that of the pipeline.
    #[arg(long, value_name = "TWIN")]
    twin: Option<PathBuf>,
    /// Name of the cell; by default the only cell of the pipeline.
    #[arg(long, value_name = "NAME")]
    cell: Option<String>,
    /// The arm, for example its serial number, by which it keeps its history when it moves to another cell. By
    /// default the cell's name.
    #[arg(long, value_name = "ID")]
    arm: Option<String>,
    /// Unit of the measured effort, without a pipeline file.
    #[arg(long, value_parser = effort_unit(), default_value_t)]
    effort_unit: EffortUnit,
    /// Torque constant of a joint in N m/A, without a pipeline file; for all joints or for none.
    #[arg(long, value_name = "JOINT=CONSTANT", value_parser = super::calibrate::joint_constant)]
    torque_constant: Vec<(String, f64)>,
    /// Topic of the measured joint states.
    #[arg(long, value_name = "TOPIC", default_value = "/joint_states")]
    state_topic: String,
    /// Topic of temperatures (`sensor_msgs/Temperature`): of the joint that the frame names, or of all.
    #[arg(long, value_name = "TOPIC")]
    temperature_topic: Option<String>,
    /// For a folder: length of the measured period, up to its newest recording [h].
    #[arg(long, value_name = "HOURS", default_value_t = 24.0)]
    hours: f64,
    #[command(flatten)]
    force: Force,
    /// Print the numbers as JSON.
    #[arg(long)]
    json: bool,
}

/// Measures the arm and writes the table.
pub fn run(args: &Args, out: &mut Output) -> Result<Exit, Failure> {
    let Choice {
        recordings,
        hours_since_start,
    } = physics::choose(&args.recordings, args.hours)?;
    let (request, cell) = request(args, &recordings)?;
    let night = Night {
        cell: &cell,
        arm: args.arm.as_deref().unwrap_or(&cell),
        temperature_topic: args.temperature_topic.as_deref(),
        hours_since_start,
    };
    let (rows, lost) = physics::rows(&request, &night)?;
    let stamp_ns = rows.first().map_or(0, |row| row.stamp_ns);
    let path = physics::path(&args.out, &cell, stamp_ns)?;
    args.force.check([path.clone()])?;
    let hold = interrupt::hold();
    physics::write(&path, &rows)?;
    drop(hold);
    if args.json {
        let all: Vec<_> = rows.iter().map(json).collect();
        out.print(&serde_json::to_string_pretty(&all).map_err(anyhow::Error::from)?)?;
    } else {
        out.print(&text(&rows))?;
        out.say(&format!("wrote {}", path.display()));
    }
    Ok(Exit::from_loss(lost > 0))
}

/// Returns the request to measure, and the cell's name.
fn request(args: &Args, recordings: &[PathBuf]) -> Result<(Request, String), Failure> {
    let loaded = args
        .pipeline
        .as_deref()
        .map(Pipeline::load_to_replay)
        .transpose()?;
    let Some(pipeline) = loaded else {
        let request = from_arguments(
            &Arguments {
                robot: args.robot.as_deref(),
                effort_unit: args.effort_unit,
                torque_constants_nm_per_a: args.torque_constant.iter().cloned().collect(),
                twin: args.twin.as_deref(),
                twin_topic: None,
                state_topic: Some(&args.state_topic),
                command_topic: None,
                fit: recordings,
                holdout: &[],
            },
            std::collections::BTreeSet::new(),
        )?;
        let name = args
            .cell
            .clone()
            .unwrap_or_else(|| request.cell.facts.name.clone());
        return Ok((
            Request {
                longest_s: LONGEST_S,
                ..request
            },
            name,
        ));
    };
    let name = match (&args.cell, pipeline.cells.len()) {
        (Some(name), _) => name.clone(),
        (None, 1) => pipeline.cells.keys().next().cloned().unwrap_or_default(),
        (None, _) => {
            let problem = Problem::of_file(&pipeline.path, "several cells; which one is measured?");
            return Err(Failure::Rejected(
                problem.help("give its name with --cell").into(),
            ));
        }
    };
    let Some(cell) = pipeline.cells.get(&name) else {
        let problem = Problem::of_file(&pipeline.path, format!("there is no cell `{name}`"));
        return Err(Failure::Rejected(problem.into()));
    };
    let of_cell = pipeline
        .stages
        .iter()
        .filter(|stage| stage.cells.contains(&name));
    let twins = of_cell.filter_map(|stage| stage.settings.get::<TwinSettings>());
    let model = twins.filter_map(|twin| twin.config.model.clone());
    // Relative to the pipeline file, as in `run` and `replay`.
    let folder = pipeline.path.parent().unwrap_or(Path::new(""));
    let model = model.map(|path| folder.join(path));
    let twin = args.twin.clone().or_else(|| model.into_iter().next());
    let request = Request::of_cell(cell.clone(), &args.state_topic, twin, recordings)?;
    Ok((
        Request {
            longest_s: LONGEST_S,
            ..request
        },
        name,
    ))
}

fn json(row: &Row) -> serde_json::Value {
    let known = |value: f64| value.is_finite().then_some(value);
    serde_json::json!({
        "cell": row.cell, "robot": row.robot, "arm": row.arm,
        "joint": (!row.joint.is_empty()).then_some(&row.joint),
        "quantity": row.quantity, "unit": row.unit, "twin_sha256": row.twin_sha256,
        "stamp_ns": row.stamp_ns, "recordings": row.recordings,
        "value": row.value, "low_95": row.low_95, "high_95": row.high_95,
        "temperature_c": known(row.temperature_c), "hours_since_start": known(row.hours_since_start),
    })
}

fn text(rows: &[Row]) -> String {
    let mut table = comfy_table::Table::new();
    table
        .load_preset(comfy_table::presets::NOTHING)
        .set_header([
            "joint",
            "quantity",
            "value",
            "95 % interval",
            "unit",
            "temperature",
        ]);
    for row in rows {
        table.add_row([
            if row.joint.is_empty() {
                "-".to_owned()
            } else {
                row.joint.clone()
            },
            row.quantity.clone(),
            format!("{:.4}", row.value),
            format!("{:.4} to {:.4}", row.low_95, row.high_95),
            row.unit.clone(),
            if row.temperature_c.is_finite() {
                format!("{:.1} deg C", row.temperature_c)
            } else {
                "-".to_owned()
            },
        ]);
    }
    table
        .lines()
        .map(|line| line.trim_end().to_owned() + "\n")
        .collect()
}
