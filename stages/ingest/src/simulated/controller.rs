//! Controllers of the arm. They know the URDF and the tool, but no physics beyond these.

mod impedance;
mod joint;

use tauscope_dynamics::Model;

use super::error::ScenarioError;
use super::plant::Drive;
use super::scenario::ControllerSettings;
use super::trajectory::{JointRange, Target};
use impedance::ImpedanceController;
use joint::JointController;

/// A controller for one arm.
#[derive(Debug)]
pub(super) enum Controller {
    /// Position control of each joint.
    Joint(Box<JointController>),
    /// Cartesian impedance control of the tool.
    Impedance(Box<ImpedanceController>),
}

impl Controller {
    /// Creates the controller that the settings select, for an arm that starts at `position`.
    pub fn new(
        model: &Model,
        settings: &ControllerSettings,
        joints: &[JointRange],
        position: &[f64],
    ) -> Result<Self, ScenarioError> {
        let Some(impedance) = &settings.impedance else {
            let joint = JointController::new(model, settings, joints, position);
            return Ok(Self::Joint(Box::new(joint)));
        };
        let alone = ControllerSettings {
            impedance: Some(impedance.clone()),
            ..ControllerSettings::default()
        };
        if *settings != alone {
            return Err(ScenarioError::Range {
                what: "controller",
                reason:
                    "`natural_hz`, `damping` and `integral_time_s` are of the joint controller, \
                         `impedance` takes its place: leave out the one or the others"
                        .to_owned(),
            });
        }
        let impedance = ImpedanceController::new(model, impedance, joints)?;
        Ok(Self::Impedance(Box::new(impedance)))
    }

    /// Takes a new target, `dt_s` after the previous one, and the encoder readings.
    pub fn update(&mut self, dt_s: f64, target: &Target, position: &[f64], velocity: &[f64]) {
        match self {
            Self::Joint(joint) => joint.update(dt_s, target, position),
            Self::Impedance(impedance) => impedance.update(target, position, velocity),
        }
    }

    /// Returns the command to the drives, `elapsed_s` after the target.
    pub fn drive(&mut self, elapsed_s: f64) -> Drive<'_> {
        match self {
            Self::Joint(joint) => joint.drive(elapsed_s),
            Self::Impedance(impedance) => impedance.drive(),
        }
    }
}
