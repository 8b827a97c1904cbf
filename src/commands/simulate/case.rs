//! The case file of a scenario that conceals physics, as input of `tauscope explain`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::Serialize;
use tauscope_archive::whole_file::{self, Existing};
use tauscope_ingest::simulated::{EffortUnit, fit_count};
use tauscope_pipeline::scenario::ScenarioFacts;

/// A case file as read by [`tauscope_pipeline::files::CaseFile`].
#[expect(clippy::struct_field_names, reason = "the key is the file's")]
#[derive(Debug, Serialize)]
struct Case<'a> {
    case: &'a str,
    robot: PathBuf,
    effort_unit: EffortUnit,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    torque_constants_nm_per_a: &'a BTreeMap<String, f64>,
    topics: Topics,
    fit: Vec<String>,
    holdout: Vec<String>,
    rate_hz: f64,
    has_velocity: bool,
}

#[derive(Debug, Serialize)]
struct Topics {
    state: &'static str,
    command: &'static str,
}

/// Writes `case.yaml` and the URDF to the folder of the recordings. All recordings but the last two are to be fitted.
///
/// # Errors
/// If a file cannot be written.
pub fn write(facts: &ScenarioFacts, out: &Path) -> anyhow::Result<PathBuf> {
    let scenario = &facts.scenario;
    let files = scenario.recordings.iter();
    let mut fit: Vec<_> = files.map(|each| format!("{}.mcap", each.name)).collect();
    let holdout = fit.split_off(fit_count(fit.len()).min(fit.len()));
    let case = Case {
        case: &scenario.name,
        robot: put_robot(facts, out)?,
        effort_unit: scenario.effort_unit,
        torque_constants_nm_per_a: &scenario.torque_constants_nm_per_a,
        topics: Topics {
            state: "/joint_states",
            command: "/joint_commands",
        },
        fit,
        holdout,
        rate_hz: scenario.rate_hz,
        has_velocity: scenario.sensors.velocity,
    };
    let path = out.join("case.yaml");
    let text = serde_saphyr::to_string(&case).context("the case")?;
    put(&path, &text)?;
    Ok(path)
}

/// Writes the URDF to the folder of the recordings, and returns its name there.
///
/// # Errors
/// If it cannot be written.
pub fn put_robot(facts: &ScenarioFacts, out: &Path) -> anyhow::Result<PathBuf> {
    let robot = robot_name(facts);
    let path = out.join(&robot);
    if !std::fs::read(&path).is_ok_and(|there| there == facts.urdf.as_bytes()) {
        put(&path, &facts.urdf)?;
    }
    Ok(robot)
}

/// Returns the name of the URDF in the folder of the recordings.
pub fn robot_name(facts: &ScenarioFacts) -> PathBuf {
    let robot = facts.scenario.robot.file_name();
    robot.unwrap_or("robot.urdf".as_ref()).into()
}

/// Writes a file whole or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn put(path: &Path, text: &str) -> anyhow::Result<()> {
    whole_file::write(path, text, Existing::Replace).with_context(|| path.display().to_string())
}
