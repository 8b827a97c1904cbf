//! The twin's part of the pipeline file.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::twin_file::Filters;

/// A digital twin, which computes the effort that the robot's motion requires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The corrected twin that `tauscope calibrate` or `tauscope explain` wrote (`twin.yaml`). Without
    /// it the twin is the uncorrected rigid-body model of the URDF.
    pub model: Option<PathBuf>,
    /// The motion whose effort is computed.
    pub motion: Motion,
    /// Source of the expected effort.
    pub expected: Expected,
    /// Cutoff of the low-pass on the velocity before it is differentiated to the acceleration \[Hz\]. Default: that
    /// of the `model`, else 12.
    #[schemars(range(min = 0.01, max = 10_000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_cutoff_hz: Option<f64>,
    /// Cutoff of the low-pass on both measured and expected effort \[Hz\]; the residual is the difference of the
    /// filtered efforts. Default: that of the `model`, else 4.5.
    #[schemars(range(min = 0.01, max = 10_000.0))]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub effort_cutoff_hz: Option<f64>,
    /// Gap between two samples above which the filters are reset \[s\].
    #[schemars(range(min = 0.001, max = 3600.0))]
    pub max_gap_s: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            model: None,
            motion: Motion::Measured,
            expected: Expected::Model,
            velocity_cutoff_hz: None,
            effort_cutoff_hz: None,
            max_gap_s: 0.25,
        }
    }
}

impl Config {
    /// Returns the low-pass cutoffs: those set here, else those of the `model`, else the defaults.
    pub fn filters(&self, model: Option<Filters>) -> Filters {
        let made_with = model.unwrap_or_default();
        Filters {
            velocity_cutoff_hz: (self.velocity_cutoff_hz).unwrap_or(made_with.velocity_cutoff_hz),
            effort_cutoff_hz: self.effort_cutoff_hz.unwrap_or(made_with.effort_cutoff_hz),
        }
    }

    /// Returns this configuration with the given low-pass cutoffs.
    #[must_use]
    pub fn with(self, filters: Filters) -> Self {
        Self {
            velocity_cutoff_hz: Some(filters.velocity_cutoff_hz),
            effort_cutoff_hz: Some(filters.effort_cutoff_hz),
            ..self
        }
    }
}

/// The motion whose effort the twin computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// The measured positions and velocities.
    #[default]
    Measured,
    /// The measured velocities, integrated from the first position, as a simulator driven by them
    /// would move (Tajiri and Iwamoto, section III-C).
    VelocityHistory,
    /// The commanded motion (Indri, Trapani and Lazzero, equation 2).
    Commanded,
}

/// Source of the expected effort.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Expected {
    /// The robot's rigid-body model.
    #[default]
    Model,
    /// An external twin, whose effort the source reads from a topic.
    Topic,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_low_pass_that_nobody_gives_is_the_models() {
        let model = Filters {
            velocity_cutoff_hz: 20.0,
            effort_cutoff_hz: 4.0,
        };
        let given = Config {
            velocity_cutoff_hz: Some(15.0),
            ..Config::default()
        };
        let wanted = Filters {
            velocity_cutoff_hz: 15.0,
            effort_cutoff_hz: 4.0,
        };
        assert_eq!(given.filters(Some(model)), wanted);
        assert_eq!(Config::default().filters(None), Filters::default());
    }
}
