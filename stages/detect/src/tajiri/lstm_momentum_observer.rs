//! `lstm_momentum_observer`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 5, after Lim et al. 2021.
//!
//! A recurrent network learns from contact-free motion the external torque that the momentum observer estimates
//! without a contact, because of friction and model errors. Its inputs are q(t), q̇(t) and q̇(t-1), scaled by
//! equation 8. The score is the squared length of the observed torque minus the network's estimate.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{LearnError, ScoreUnit, SignalSettings, Task, Trained};
use crate::tajiri::learned::{self, GivenTraining, Load, Lstm, TrainedSettings, TrainingSettings};

/// Settings of `lstm_momentum_observer`. All except `model` apply to its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// Settings of its input signals.
    pub signals: SignalSettings,
    /// Number of samples in a training sequence, and before the first score.
    #[schemars(range(min = 2, max = 100_000))]
    pub sequence: usize,
    /// Number of units of the recurrent layer.
    #[schemars(range(min = 1, max = 10_000))]
    pub hidden: usize,
    /// Training of the network. `batch` is a number of samples: 1000 are ten sequences of 100.
    #[serde(deserialize_with = "learned::training::<Settings, _>")]
    #[schemars(with = "GivenTraining")]
    pub training: TrainingSettings,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: None,
            signals: SignalSettings::default(),
            sequence: 100,
            hidden: 100,
            training: TrainingSettings {
                epochs: 60,
                batch: 1000,
                dropout: 0.0,
                learning_rate: 1e-4,
            },
        }
    }
}

impl TrainedSettings for Settings {
    const NAME: &'static str = "lstm_momentum_observer";
    const ABOUT: &'static str =
        "Momentum observer minus an LSTM's estimate of it (Tajiri and Iwamoto, after Lim et al.).";
    const SCORE_UNIT: ScoreUnit = ScoreUnit::SquaredTorque;
    const RANDOM: bool = true;
    const LOAD: Load = Lstm::scorer;

    fn model(&mut self) -> &mut Option<PathBuf> {
        &mut self.model
    }

    fn train(&self, task: &Task<'_>) -> Result<Trained, LearnError> {
        Lstm::train(
            Self::NAME,
            &self.signals,
            [self.hidden, self.sequence],
            &self.training,
            task,
        )
    }

    fn training(&self) -> Option<TrainingSettings> {
        Some(self.training)
    }
}
