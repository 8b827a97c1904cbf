//! `point_autoencoder`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 4.
//!
//! An autoencoder over the external torques that the momentum observer estimates at one sample,
//! scaled by equation 8. The score is the mean squared reconstruction error.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{LearnError, SignalSettings, Task, Trained};
use crate::tajiri::learned::{
    self, Autoencoder, GivenTraining, Load, TrainedSettings, TrainingSettings,
};

/// Number of samples behind one score.
const WINDOW: usize = 1;

/// Settings of `point_autoencoder`. All except `model` apply to its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Settings of its input signals.
    pub signals: SignalSettings,
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
            layers: vec![5, 3, 5],
            training: TrainingSettings {
                epochs: 300,
                batch: 1000,
                dropout: 0.1,
                learning_rate: 1e-4,
            },
        }
    }
}

impl TrainedSettings for Settings {
    const NAME: &'static str = "point_autoencoder";
    const ABOUT: &'static str =
        "Autoencoder over the external torques of one sample (Tajiri and Iwamoto).";
    const RANDOM: bool = true;
    const LOAD: Load = Autoencoder::scorer;

    fn model(&mut self) -> &mut Option<PathBuf> {
        &mut self.model
    }

    fn train(&self, task: &Task<'_>) -> Result<Trained, LearnError> {
        let windows = [WINDOW, 1];
        Autoencoder::train(
            Self::NAME,
            &self.signals,
            windows,
            (&self.layers, &self.training),
            task,
        )
    }

    fn training(&self) -> Option<TrainingSettings> {
        Some(self.training)
    }
}
