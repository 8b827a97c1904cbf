//! What a simulated source simulates: the scenario and its robot.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tauscope_dynamics::{Model, ModelError};
use tauscope_ingest::SimulatedRobot;
use tauscope_ingest::simulated::Scenario;

use crate::report::Report;
use crate::yaml::{self, Place};

/// A scenario and its robot, as they can be handed to another process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ScenarioFacts {
    /// The scenario, its paths resolved.
    pub scenario: Scenario,
    /// The robot's URDF as text.
    pub urdf: String,
}

impl ScenarioFacts {
    /// Reads the scenario at `path` and the robot it names.
    ///
    /// # Errors
    /// What is wrong with either, with its place.
    pub fn load(path: &Path) -> Result<Self, Report> {
        let file = yaml::load::<Scenario>(path)?;
        let place = Place::root().key("robot");
        let robot = file.resolve(&file.value.robot);
        let urdf = std::fs::read_to_string(&robot)
            .map_err(|error| file.at(&place, format!("cannot read the URDF: {error}")))?;
        Model::from_urdf(&urdf)
            .map_err(|error| file.at(&place, format!("cannot use the URDF: {error}")))?;
        let mut scenario = file.value.clone();
        for path in scenario.paths_mut() {
            *path = file.resolve(path);
        }
        Ok(Self { scenario, urdf })
    }

    /// What a simulated source is made of.
    ///
    /// # Errors
    /// None after [`ScenarioFacts::load`], which reads the URDF too.
    pub fn robot(&self) -> Result<SimulatedRobot, ModelError> {
        Ok(SimulatedRobot {
            scenario: self.scenario.clone(),
            model: Model::from_urdf(&self.urdf)?,
        })
    }
}
