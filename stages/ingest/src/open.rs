//! From a configuration to a source that runs.

use tauscope_bus::{JointState, Source};
use tauscope_dynamics::Model;

use crate::config::{Config, Input};
use crate::error::IngestError;
use crate::pacing::Paced;
use crate::recorded::RecordedSource;
use crate::setup::Setup;
use crate::simulated::{Scenario, ScenarioError, SimulatedCell};
use crate::zenoh::ZenohSource;

/// What a simulated cell needs besides its configuration; the program loads both files.
#[derive(Debug, Clone)]
pub struct SimulatedRobot {
    /// The scenario, its paths resolved.
    pub scenario: Scenario,
    /// The robot that the scenario names.
    pub model: Model,
}

/// Opens the source that `config` names, paced as it says. `robot` is needed by `simulate` only.
///
/// # Errors
/// If the source cannot be opened; [`IngestError::is_input`] tells whose fault that is.
pub fn open(
    config: &Config,
    setup: &Setup,
    robot: Option<&SimulatedRobot>,
) -> Result<Box<dyn Source<JointState>>, IngestError> {
    match config.input()? {
        Input::File(file) => {
            let source = RecordedSource::open_file(file, config, setup)?;
            Ok(paced(source, config))
        }
        Input::Csv(csv) => {
            let source = RecordedSource::open_csv(csv, config, setup)?;
            Ok(paced(source, config))
        }
        Input::Simulate(simulate) => {
            let robot = robot.ok_or(ScenarioError::NotLoaded)?;
            let name = simulate.recording.as_deref();
            let source = SimulatedCell::new(&robot.scenario, &robot.model, name, config, setup)?;
            Ok(paced(source, config))
        }
        Input::Zenoh(zenoh) => Ok(Box::new(ZenohSource::open(zenoh, config, setup)?)),
    }
}

fn paced(
    source: impl Source<JointState> + 'static,
    config: &Config,
) -> Box<dyn Source<JointState>> {
    match config.rate.factor() {
        Some(factor) => Box::new(Paced::new(source, factor)),
        None => Box::new(source),
    }
}
