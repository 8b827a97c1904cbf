//! `point_ocsvm`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 3.
//!
//! A one-class support vector machine with a Gaussian kernel over the external torques that the momentum
//! observer estimates at one sample, scaled by equation 8, ν = 0.1. The score is
//! `ρ - Σ α_i k(x_i, x)`: positive outside the boundary that encloses all but a share ν of the training data.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{LearnError, SignalSettings, Task, Trained};
use crate::tajiri::learned::{Load, OneClass, TrainedSettings};

/// Number of samples behind one score.
const WINDOW: usize = 1;

/// Settings of `point_ocsvm`. All except `model` apply to its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Settings of its input signals.
    pub signals: SignalSettings,
    /// Upper bound of the share of training data outside the boundary.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub nu: f64,
    /// Distance between two training samples \[samples\].
    #[schemars(range(min = 1))]
    pub stride: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: None,
            signals: SignalSettings::default(),
            nu: 0.1,
            stride: 1,
        }
    }
}

impl TrainedSettings for Settings {
    const NAME: &'static str = "point_ocsvm";
    const ABOUT: &'static str = "One-class support vector machine over the external torques of one sample (Tajiri and Iwamoto).";
    const RANDOM: bool = false;
    const LOAD: Load = OneClass::scorer;

    fn model(&mut self) -> &mut Option<PathBuf> {
        &mut self.model
    }

    fn train(&self, task: &Task<'_>) -> Result<Trained, LearnError> {
        OneClass::train(
            Self::NAME,
            &self.signals,
            [WINDOW, self.stride],
            self.nu,
            task,
        )
    }

    fn largest_score(trained: &Trained) -> Option<f64> {
        OneClass::largest_score(trained)
    }
}
