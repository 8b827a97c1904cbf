//! The simulated cell as a live source.

use tauscope_bus::{Emit, JointState, Progress, Source, StageError};
use tauscope_dynamics::Model;

use super::error::ScenarioError;
use super::messages::CellMessages;
use super::scenario::Scenario;
use super::simulation::Simulation;
use crate::config::Config;
use crate::error::IngestError;
use crate::pack::{PackSettings, Packer};
use crate::setup::Setup;

/// A source that simulates one recording of a scenario on demand.
#[derive(Debug)]
pub struct SimulatedCell {
    simulation: Simulation,
    messages: CellMessages,
    packer: Packer,
}

impl SimulatedCell {
    /// Creates the source of the scenario's recording `name`, or of its first; `model` is the robot that it names.
    ///
    /// # Errors
    /// If there is no such recording, or the scenario does not fit the robot.
    pub fn new(
        scenario: &Scenario,
        model: &Model,
        name: Option<&str>,
        config: &Config,
        setup: &Setup,
    ) -> Result<Self, IngestError> {
        let index = match name {
            None => Some(0),
            Some(name) => scenario
                .recordings
                .iter()
                .position(|each| each.name == name),
        };
        let index = index
            .filter(|&index| index < scenario.recordings.len())
            .ok_or_else(|| ScenarioError::Recording {
                name: name.unwrap_or_default().to_owned(),
                reason: "is not there",
                known: scenario.recording_names(),
            })?;
        let settings = PackSettings {
            velocity_cutoff_hz: config.velocity_cutoff_hz,
            max_age_ns: (config.max_age_s * 1e9) as i64,
            wait_ns: 0,
            expects_command: true,
            expects_reference: false,
        };
        Ok(Self {
            simulation: Simulation::new(scenario, model, index)?,
            messages: CellMessages::new(model, scenario.sensors.velocity),
            packer: Packer::new(setup, settings)?,
        })
    }
}

impl Source<JointState> for SimulatedCell {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        let reading = self
            .simulation
            .next_reading()
            .map_err(|error| StageError::failed(IngestError::from(error)))?;
        let Some(reading) = reading else {
            return Ok(Progress::End);
        };
        self.messages.fill(&reading);
        self.packer
            .command(&self.messages.command, reading.stamp_ns);
        self.packer.learn(self.messages.learn);
        self.packer.state(&self.messages.state, reading.stamp_ns);
        while let Some(sample) = self.packer.pop(reading.stamp_ns) {
            out.emit(&mut |slot| *slot = sample)?;
        }
        Ok(Progress::More)
    }

    fn dropped(&self) -> u64 {
        self.packer.counts().dropped()
    }

    fn fraction_done(&self) -> Option<f64> {
        Some(self.simulation.fraction_done())
    }
}
