//! `window_autoencoder`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 7.
//!
//! An autoencoder over the external torques that the momentum observer sees at 16 samples in a row
//! (Park et al. 2021),
//! scaled by equation 8. The score is the mean square of what it does not give back.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{LearnError, SignalSettings, Task, Trained};
use crate::tajiri::learned::{
    self, Autoencoder, GivenTraining, Load, TrainedSettings, TrainingSettings,
};

/// Settings of `window_autoencoder`. All but `model` are those of its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The signals it sees.
    pub signals: SignalSettings,
    /// Samples in a window.
    #[schemars(range(min = 1, max = 10_000))]
    pub window: usize,
    /// It is trained on a window every so many samples.
    #[schemars(range(min = 1))]
    pub stride: usize,
    /// Units of the middle layers.
    pub layers: Vec<usize>,
    /// How it is trained.
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
