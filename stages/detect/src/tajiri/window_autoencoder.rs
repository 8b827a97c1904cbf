//! `window_autoencoder`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 7.
//!
//! An autoencoder over the external torques that the momentum observer estimates at 16 consecutive samples
//! (Park et al. 2021), scaled by equation 8. The score is the mean squared reconstruction error.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{LearnError, SignalSettings, Task, Trained};
use crate::tajiri::learned::{
    self, Autoencoder, GivenTraining, Load, TrainedSettings, TrainingSettings,
};

/// Settings of `window_autoencoder`. All except `model` apply to its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Settings of its input signals.
    pub signals: SignalSettings,
    /// Number of samples in a window.
    #[schemars(range(min = 1, max = 10_000))]
    pub window: usize,
    /// Distance between two training windows \[samples\].
    #[schemars(range(min = 1))]
    pub stride: usize,
    /// Number of units of each hidden layer.
    pub layers: Vec<usize>,
    /// Training of the network.
    #[serde(deserialize_with = "learned::training::<Settings, _>")]
    #[schemars(with = "GivenTraining")]
    pub training: TrainingSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: None,
            signals: SignalSettings::default(),
            window: 16,
            // As for `window_ocsvm`.
            stride: 16,
            layers: vec![32, 11, 32],
            training: TrainingSettings {
                epochs: 1000,
                batch: 128,
                dropout: 0.1,
                learning_rate: 1e-4,
            },
        }
    }
}

impl TrainedSettings for Settings {
    const NAME: &'static str = "window_autoencoder";
    const ABOUT: &'static str = "`point_autoencoder` over windows (after Park et al.).";
    const RANDOM: bool = true;
    const LOAD: Load = Autoencoder::scorer;

    fn model(&mut self) -> &mut Option<PathBuf> {
        &mut self.model
    }

    fn train(&self, task: &Task<'_>) -> Result<Trained, LearnError> {
        let windows = [self.window, self.stride];
        Autoencoder::train(
            Self::NAME,
            &self.signals,
            windows,
            (&self.layers, &self.training),
            task,
        )
    }

    fn window(&self) -> Option<usize> {
        Some(self.window)
    }

    fn training(&self) -> Option<TrainingSettings> {
        Some(self.training)
    }
}
