//! The score at which an alarm is raised.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ConfigError;
use super::setup::Setup;

/// The score at which the alarm is raised: at most one of the two keys.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Threshold {
    /// Threshold in standard deviations above the mean score. Both are measured on contact-free data and read from
    /// `twin.yaml`. Default: 4; for `momentum_observer` 3.
    #[schemars(range(min = 0.0, max = 1000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<f64>,
    /// Threshold as an absolute score.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
}

impl Threshold {
    /// Default number of standard deviations above the mean (equation 7 of Tajiri and Iwamoto).
    /// Tuned: by Tajiri and Iwamoto (section V), on their robot.
    pub const SIGMAS: f64 = 4.0;

    /// Returns the score at which `detector` raises the alarm (equation 7 of Tajiri and Iwamoto: mean +
    /// k standard deviations, where k defaults to `usual`).
    ///
    /// # Errors
    /// If both kinds are given, or the threshold is in standard deviations and they have not been measured.
    pub fn resolve(
        &self,
        detector: &'static str,
        usual: f64,
        setup: &Setup,
    ) -> Result<f64, ConfigError> {
        match (self.sigmas, self.score) {
            (Some(_), Some(_)) => Err(ConfigError::TwoThresholds),
            (None, Some(score)) => Ok(score),
            (sigmas, None) => {
                let sigmas = sigmas.unwrap_or(usual);
                match setup.statistics(detector) {
                    Some(score) => Ok(score.mean + sigmas * score.standard_deviation),
                    None => Err(ConfigError::NoStatistics { detector, sigmas }),
                }
            }
        }
    }
}
