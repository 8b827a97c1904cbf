//! `tauscope physics` around the engine: from recordings of a day to a table of estimates with intervals.

mod night;
mod temperature;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tauscope_archive::Recording as Archive;
use tauscope_condition::Quantity;
use tauscope_explain::{Measured, measure};
use tauscope_fleet::physics::{Row, TABLE, folder_of};
use tauscope_pipeline::provenance;
use tauscope_pipeline::report::{Problem, Report};
use tauscope_pipeline::tables::{floats, integers, strings, write_table};

use crate::exit::Failure;
use crate::explain::{Request, read};

pub use night::{Choice, LONGEST_S, choose};

/// Description of a night's measurement, apart from the recordings.
#[derive(Debug)]
pub struct Night<'a> {
    /// The cell.
    pub cell: &'a str,
    /// The arm.
    pub arm: &'a str,
    /// Topic of `sensor_msgs/msg/Temperature`; `None` where no temperature is recorded.
    pub temperature_topic: Option<&'a str>,
    /// Time since the robot was started, averaged over the recordings \[h\]; `None` if unknown.
    pub hours_since_start: Option<f64>,
}

/// Measures the arm; returns the rows of the night's table, and the number of data rows lost on reading.
///
/// # Errors
/// If a recording cannot be read, or the recordings allow no estimate.
pub fn rows(request: &Request, night: &Night<'_>) -> Result<(Vec<Row>, u64), Failure> {
    let input = read(request, &|_, _| {})?;
    let lost = input
        .fit
        .iter()
        .map(|recording| recording.losses.lost())
        .sum();
    let stamp_ns = input
        .fit
        .iter()
        .map(|recording| recording.start_ns)
        .min()
        .unwrap_or(0);
    let measured = measure(&input).map_err(|error| Failure::rejected(error.to_string()))?;
    let Measured { numbers, in_nm } = measured
        .map_err(|reason| Failure::rejected(format!("nothing can be measured: {reason}")))?;
    let joints = &request.cell.facts.joint_names;
    let temperatures = match night.temperature_topic {
        Some(topic) => {
            let paths = request.fit.iter().map(|named| named.path.as_path());
            temperature::of_joints(paths, topic, joints)?
        }
        None => vec![None; joints.len()],
    };
    let twin_sha256 = match &request.start {
        Some(start) => provenance::sha256_of_file(&start.path).context("the twin")?,
        None => String::new(),
    };
    let robot = request.cell.model.as_ref().map_or("", |model| model.name());
    let effort = |joint: Option<usize>| {
        let is_known = joint.is_none_or(|joint| in_nm[joint]);
        if is_known { "N m" } else { "A" }
    };
    let rows = numbers.into_iter().map(|number| Row {
        cell: night.cell.to_owned(),
        robot: robot.to_owned(),
        arm: night.arm.to_owned(),
        joint: number
            .joint
            .map(|joint| joints[joint].clone())
            .unwrap_or_default(),
        quantity: number.name.to_owned(),
        unit: Quantity::of_name(number.name)
            .map_or_else(String::new, |one| one.unit(effort(number.joint))),
        twin_sha256: twin_sha256.clone(),
        stamp_ns: u64::try_from(stamp_ns).unwrap_or(0),
        recordings: input.fit.len() as u64,
        value: number.value,
        low_95: number.interval[0],
        high_95: number.interval[1],
        temperature_c: number
            .joint
            .and_then(|joint| temperatures[joint])
            .unwrap_or(f64::NAN),
        hours_since_start: night.hours_since_start.unwrap_or(f64::NAN),
    });
    Ok((rows.collect(), lost))
}

/// Returns the path of a night's table: `cell=CELL/date=DATE/physics-TIME.parquet`, by the first recording's stamp in
/// UTC.
///
/// # Errors
/// If the stamp is invalid, or the cell's name cannot be that of a folder.
pub fn path(history: &Path, cell: &str, stamp_ns: u64) -> Result<PathBuf, Failure> {
    if cell.is_empty() || cell.starts_with('.') || cell.contains(['/', '\\', '=', '\0']) {
        return Err(Failure::rejected(format!(
            "`{cell}` cannot be the name of a folder; give --cell"
        )));
    }
    let stamp = jiff::Timestamp::from_nanosecond(i128::from(stamp_ns)).context("the stamp")?;
    let folder = folder_of(history, cell, &stamp.strftime("%Y-%m-%d").to_string());
    Ok(folder.join(format!("{TABLE}-{}.parquet", stamp.strftime("%H%M%S"))))
}

/// Writes the table.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, rows: &[Row]) -> Result<(), Failure> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::rejected(format!("cannot make {}: {error}", folder.display()))
        })?;
    }
    let texts = Row::TEXTS.map(|(name, of)| {
        (
            name,
            strings(rows.iter().map(|row| of(row).clone()).collect()),
        )
    });
    let counts = Row::COUNTS.map(|(name, of)| (name, integers(rows.iter().map(of).collect())));
    let numbers = Row::NUMBERS.map(|(name, of)| (name, floats(rows.iter().map(of).collect())));
    let columns = texts.into_iter().chain(counts).chain(numbers);
    write_table(path, columns).context("the table")?;
    Ok(())
}

/// Opens a recording without reading its messages.
fn open(path: &Path) -> Result<Archive, Report> {
    Archive::open(path).map_err(|error| Problem::new(error.to_string()).into())
}
