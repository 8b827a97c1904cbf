//! Writes a scenario's recordings.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tauscope_archive::whole_file::{self, Existing};
use tauscope_archive::{Compression, McapWriter, Written, ros};
use tauscope_dynamics::Model;

use super::conceal;
use super::error::ScenarioError;
use super::labels::{Labels, RecordingLabels};
use super::messages::CellMessages;
use super::scenario::Scenario;
use super::simulation::Simulation;

/// Files written by [`simulate`].
#[derive(Debug)]
pub struct Simulated {
    /// The recordings, in the scenario's order.
    pub recordings: Vec<Written>,
    /// Path of the labels.
    pub labels_path: PathBuf,
    /// The labels themselves.
    pub labels: Labels,
    /// Path of the file with the concealed effects, for a scenario that conceals any.
    pub concealed_path: Option<PathBuf>,
}

/// Simulates all recordings of the scenario and writes them to the folder `out`.
///
/// Each `<name>.mcap` has the topics `/joint_states`, `/joint_commands` and `/contact`, and `/learn` if learning is
/// requested. The labels are written to `labels.json`, the effects that a scenario conceals to `concealed.json`.
///
/// `provenance` is written into each file. `progress` receives the completed fraction, from 0 to 1, and aborts
/// the work by returning `false`. The result is `None` then, and the current recording remains a `.part` file.
///
/// # Errors
/// If the scenario does not fit the robot, the arm runs away, or a file cannot be written.
pub fn simulate(
    scenario: &Scenario,
    model: &Model,
    out: &Path,
    provenance: &BTreeMap<String, String>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Simulated>, ScenarioError> {
    check_names(scenario)?;
    let (open, concealed) = conceal::add(scenario, model)?;
    let scenario = &*open;
    // An error in any recording must show before anything is written.
    let simulations = (0..scenario.recordings.len())
        .map(|index| Simulation::new(scenario, model, index))
        .collect::<Result<Vec<_>, _>>()?;
    let whole_s: f64 = scenario.recordings.iter().map(|each| each.duration_s).sum();
    let mut done_s = 0.0;
    let mut labels = Labels {
        set: scenario.name.clone(),
        ..Labels::default()
    };
    let mut recordings = Vec::new();
    for (spec, mut simulation) in scenario.recordings.iter().zip(simulations) {
        let path = out.join(format!("{}.mcap", spec.name));
        let mut progress =
            |fraction: f64| progress((done_s + fraction * spec.duration_s) / whole_s);
        let messages = CellMessages::new(model, scenario.sensors.velocity);
        let written = write(&path, messages, &mut simulation, provenance, &mut progress)?;
        let Some(written) = written else {
            return Ok(None);
        };
        recordings.push(written);
        let label = {
            let cycle_s = simulation.cycle_s();
            RecordingLabels::new(spec, scenario.rate_hz, cycle_s, simulation.events())
        };
        labels.recordings.insert(spec.name.clone(), label);
        done_s += spec.duration_s;
    }
    let labels_path = out.join("labels.json");
    write_json(&labels_path, &labels)?;
    let concealed_path = match concealed {
        Some(concealed) => {
            let path = out.join("concealed.json");
            write_json(&path, &concealed)?;
            Some(path)
        }
        None => None,
    };
    Ok(Some(Simulated {
        recordings,
        labels_path,
        labels,
        concealed_path,
    }))
}

/// Writes a file atomically.
fn write_json(path: &Path, value: &impl serde::Serialize) -> Result<(), ScenarioError> {
    let unwritable = |source: std::io::Error| ScenarioError::Labels {
        path: path.to_owned(),
        source,
    };
    let mut text = serde_json::to_vec_pretty(value).map_err(|error| unwritable(error.into()))?;
    text.push(b'\n');
    whole_file::write(path, text, Existing::Replace).map_err(unwritable)
}

/// Checks that the recordings have distinct names.
fn check_names(scenario: &Scenario) -> Result<(), ScenarioError> {
    for (index, spec) in scenario.recordings.iter().enumerate() {
        if scenario.recordings[..index]
            .iter()
            .any(|other| other.name == spec.name)
        {
            return Err(ScenarioError::Recording {
                name: spec.name.clone(),
                reason: "is there twice",
                known: scenario.recording_names(),
            });
        }
    }
    Ok(())
}

/// Writes one recording; returns `None` if it was aborted.
fn write(
    path: &Path,
    mut messages: CellMessages,
    simulation: &mut Simulation,
    provenance: &BTreeMap<String, String>,
    progress: &mut dyn FnMut(f64) -> bool,
) -> Result<Option<Written>, ScenarioError> {
    let mut writer = McapWriter::create(path, Compression::Zstd, provenance)?;
    let states = writer.add_topic::<ros::JointState>("/joint_states")?;
    let commands = writer.add_topic::<ros::JointState>("/joint_commands")?;
    let contacts = writer.add_topic::<ros::Bool>("/contact")?;
    let mut requests = None;
    while let Some(reading) = simulation.next_reading()? {
        messages.fill(&reading);
        let ns = reading.stamp_ns;
        if messages.learn.data {
            // Before the state from which it takes effect.
            let topic = match requests {
                Some(topic) => topic,
                None => *requests.insert(writer.add_topic::<ros::Bool>("/learn")?),
            };
            writer.write(topic, ns, ns, &messages.learn)?;
        }
        writer.write(states, ns, ns, &messages.state)?;
        writer.write(commands, ns, ns, &messages.command)?;
        writer.write(contacts, ns, ns, &messages.contact)?;
        if !progress(simulation.fraction_done()) {
            return Ok(None);
        }
    }
    Ok(Some(writer.finish()?))
}
