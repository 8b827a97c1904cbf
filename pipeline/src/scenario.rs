//! Scenario and robot of a simulated source.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tauscope_dynamics::{Model, ModelError};
use tauscope_ingest::SimulatedRobot;
use tauscope_ingest::simulated::Scenario;

use crate::report::Report;
use crate::urdf;
use crate::yaml::{self, Place};

/// A scenario and its robot, in a form that can be sent to another process.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ScenarioFacts {
    /// The scenario with resolved paths.
    pub scenario: Scenario,
    /// The robot's URDF as text.
    pub urdf: String,
}

impl ScenarioFacts {
    /// Reads the scenario at `path` and the robot it names.
    ///
    /// # Errors
    /// All problems with either, with their places.
    pub fn load(path: &Path) -> Result<Self, Report> {
        let file = yaml::load::<Scenario>(path)?;
        let place = Place::root().key("robot");
        let robot = file.resolve(&file.value.robot);
        let robot = urdf::read(&robot).map_err(|error| file.at(&place, error.to_string()))?;
        let mut scenario = file.value.clone();
        for path in scenario.paths_mut() {
            *path = file.resolve(path);
        }
        Ok(Self {
            scenario,
            urdf: robot.urdf,
        })
    }

    /// Builds the robot for a simulated source.
    ///
    /// # Errors
    /// None after [`ScenarioFacts::load`], which already parses the URDF.
    pub fn robot(&self) -> Result<SimulatedRobot, ModelError> {
        Ok(SimulatedRobot {
            scenario: self.scenario.clone(),
            model: Model::from_urdf(&self.urdf)?,
        })
    }
}
