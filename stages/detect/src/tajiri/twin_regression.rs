//! `twin_regression`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital
//! Twin System", equations 5 to 7.
//!
//! The score is the squared length of the residual vector: measured effort minus the twin's effort
//! after the regression of equations 3 and 4, both filtered by the same low-pass in the twin stage.
//! The alarm is raised when the score reaches the mean + 4 standard deviations of the score on
//! contact-free data.

use crate::frame::{
    ConfigError, Detector, DetectorSettings, Judgement, ScoreUnit, Setup, Training,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tauscope_bus::{TwinState, flags};

/// Canonical name.
pub(crate) const NAME: &str = "twin_regression";

/// Settings of `twin_regression`: none. The filters are the twin's.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Settings {}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Squared length of the residual after the twin's regression (Tajiri and Iwamoto).";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::SquaredEffort;
    const TRAINING: Training = Training::Twin;

    fn build(&self, _setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        Ok(Box::new(TwinRegression))
    }

    fn is_calibrated(_: &Setup) -> bool {
        true
    }
}

struct TwinRegression;

impl Detector for TwinRegression {
    fn name(&self) -> &'static str {
        NAME
    }

    fn judge(&mut self, sample: &TwinState) -> Judgement {
        let joint_count = sample.header.joint_count as usize;
        Judgement {
            // Equation 5.
            score: sample.residual[..joint_count].iter().map(|r| r * r).sum(),
            ready: sample.header.has(flags::READY),
            verdict: None,
        }
    }
}
