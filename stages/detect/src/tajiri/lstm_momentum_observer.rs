//! `lstm_momentum_observer`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 5, after Lim et al. 2021.
//!
//! A recurrent net learns from contact-free motion what the momentum observer takes for external torque
//! though nothing touches the arm: friction and errors of the model. It sees q(t), q̇(t) and q̇(t-1), scaled
//! by equation 8. The score is the squared length of what the observer sees beyond the net's estimate.

use std::path::PathBuf;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

use crate::frame::{
    ConfigError, Detector, DetectorSettings, LearnError, Lessons, Setup, SignalSettings, Suits,
    Task, Trained, TrainedError, Training,
};
use crate::tajiri::learned::{
    self, Course, GivenTraining, Lstm, LstmScorer, Scorer, TrainingSettings,
};

/// Canonical name.
pub(crate) const NAME: &str = "lstm_momentum_observer";

/// Settings of `lstm_momentum_observer`. All but `model` are those of its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The signals it sees.
    pub signals: SignalSettings,
    /// Samples in a training sequence, and before the first score.
    #[schemars(range(min = 2, max = 100_000))]
    pub sequence: usize,
    /// Units of the recurrent layer.
    #[schemars(range(min = 1, max = 10_000))]
    pub hidden: usize,
    /// How it is trained. `batch` counts samples: 1000 are ten sequences of 100.
    #[serde(deserialize_with = "training")]
    #[schemars(with = "GivenTraining")]
    pub training: TrainingSettings,
}

fn training<'de, D: Deserializer<'de>>(file: D) -> Result<TrainingSettings, D::Error> {
    Ok(GivenTraining::deserialize(file)?.or(Settings::default().training))
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

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Momentum observer less what an LSTM expects of it (Tajiri and Iwamoto, after Lim et al.).";
    const TRAINING: Training = Training::Own;
    const RANDOM: bool = true;
    const SUITS: Suits = Suits::NewPaths;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        learned::build(NAME, setup, load)
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        let trained = train(self, task.setup, &task.lessons, task.seed)?;
        Ok((self.clone(), Some(trained)))
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        self.model.iter().map(|_| "model").collect()
    }

    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(&mut self.model)
    }
}

fn load(trained: &Trained) -> Result<Box<dyn Scorer>, TrainedError> {
    Ok(Box::new(LstmScorer::load(trained)?))
}

/// Trains it on the contact-free part of the training recordings.
///
/// # Errors
/// If there is no robot's model, too little data, or the training diverges.
pub fn train(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
    seed: u64,
) -> Result<Trained, LearnError> {
    learned::demand(NAME, settings.hidden > 0, "`hidden` must be at least 1")?;
    settings.training.check(NAME)?;
    let length = settings.sequence;
    let course = Course::new(NAME, &settings.signals, length, setup, lessons, seed)?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let training = &settings.training;
    let net = Lstm::fit(&course, settings.hidden, length, training, &mut rng)
        .map_err(|error| course.failed(error))?;
    course.end(|trained| net.save(trained), load)
}
