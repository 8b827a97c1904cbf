//! From which score on an alarm is raised.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ConfigError;
use super::setup::Setup;

/// From which score on the alarm is raised: at most one of the two.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Threshold {
    /// This many standard deviations above the mean of the score on contact-free data, which
    /// `twin.yaml` holds. By default 4, of `momentum_observer` 3.
    #[schemars(range(min = 0.0, max = 1000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<f64>,
    /// This score.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
}

impl Threshold {
    /// Standard deviations above the mean where neither the file nor the detector says how many (equation 7 of
    /// Tajiri and Iwamoto).
    /// Tuned: by Tajiri and Iwamoto (section V), on their robot.
    pub const SIGMAS: f64 = 4.0;

    /// The score from which on `detector` raises the alarm (equation 7 of Tajiri and Iwamoto: mean +
    /// k standard deviations, k being `usual` where the file does not say).
    ///
    /// # Errors
    /// If both kinds are given, or standard deviations are wanted and nobody has measured them.
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
