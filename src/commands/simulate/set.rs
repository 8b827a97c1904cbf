//! The labelled set of a scenario with test recordings, as input of `tauscope evaluate`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use serde::{Deserialize, Serialize};
use tauscope_ingest::simulated::{EffortUnit, Role};
use tauscope_pipeline::files::Impedance;
use tauscope_pipeline::scenario::ScenarioFacts;

use super::case;

/// A set file as read by [`tauscope_pipeline::files::SetFile`].
#[derive(Debug, Serialize)]
struct Set<'a> {
    #[serde(rename = "set")]
    name: &'a str,
    robot: PathBuf,
    labels: PathBuf,
    rate_hz: f64,
    effort_unit: EffortUnit,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    torque_constants_nm_per_a: &'a BTreeMap<String, f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tool_link: Option<&'a str>,
    topics: BTreeMap<&'static str, &'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    impedance: Option<Impedance>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cycle_s: Option<f64>,
    train: Vec<String>,
    validation: Vec<String>,
    test: Vec<String>,
}

/// Cycle lengths in the file of labels.
#[derive(Debug, Deserialize)]
struct Cycles {
    recordings: BTreeMap<String, Cycle>,
}

#[derive(Debug, Deserialize)]
struct Cycle {
    duration: f64,
    cycle_s: Option<f64>,
}

/// Writes `set.yaml` and the URDF to the folder of the recordings, if the scenario has test recordings.
///
/// # Errors
/// If a file cannot be read or written.
pub fn write(facts: &ScenarioFacts, labels: &Path, out: &Path) -> anyhow::Result<Option<PathBuf>> {
    let scenario = &facts.scenario;
    let of = |role: Role| -> Vec<String> {
        let own = scenario.recordings.iter().filter(|each| each.role == role);
        own.map(|each| format!("{}.mcap", each.name)).collect()
    };
    let test = of(Role::Test);
    if test.is_empty() {
        return Ok(None);
    }
    let impedance = scenario.controller.impedance.as_ref();
    let set = Set {
        name: &scenario.name,
        robot: case::put_robot(facts, out)?,
        labels: labels.file_name().unwrap_or(labels.as_os_str()).into(),
        rate_hz: scenario.rate_hz,
        effort_unit: scenario.effort_unit,
        torque_constants_nm_per_a: &scenario.torque_constants_nm_per_a,
        tool_link: scenario.tool.as_ref().map(|tool| tool.link.as_str()),
        topics: BTreeMap::from([
            ("state", "/joint_states"),
            ("command", "/joint_commands"),
            ("contact", "/contact"),
        ]),
        impedance: impedance.map(|impedance| Impedance {
            translational_n_per_m: impedance.translational_n_per_m,
            rotational_nm_per_rad: impedance.rotational_nm_per_rad,
            damping: None,
        }),
        cycle_s: cycle_s(labels)?,
        train: of(Role::Train),
        validation: of(Role::Validation),
        test,
    };
    let path = out.join("set.yaml");
    let text = serde_saphyr::to_string(&set).context("the set")?;
    case::put(&path, &text)?;
    Ok(Some(path))
}

/// Returns the length of a cycle \[s\], if it is equal in all recordings and each holds at least two cycles.
fn cycle_s(labels: &Path) -> anyhow::Result<Option<f64>> {
    let text = std::fs::read_to_string(labels).with_context(|| labels.display().to_string())?;
    let cycles: Cycles = serde_json::from_str(&text).context("the labels")?;
    let repeated = |of: &Cycle| of.cycle_s.filter(|cycle_s| of.duration >= 2.0 * cycle_s);
    let mut all = cycles.recordings.values().map(repeated);
    let first = all.next().flatten();
    Ok(first.filter(|first| all.all(|other| other.is_some_and(|o| (o - first).abs() < 1e-9))))
}
