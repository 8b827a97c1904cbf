//! `point_autoencoder`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 4.
//!
//! An autoencoder over the external torques that the momentum observer sees at one sample,
//! scaled by equation 8. The score is the mean square of what it does not give back.

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
    self, Autoencoder, Course, GivenTraining, Scorer, TrainingSettings, VectorScorer, Vectors,
};

/// Canonical name.
pub(crate) const NAME: &str = "point_autoencoder";

/// Samples that a score rests on.
const WINDOW: usize = 1;

/// Settings of `point_autoencoder`. All but `model` are those of its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The signals it sees.
    pub signals: SignalSettings,
    /// Units of the middle layers.
    pub layers: Vec<usize>,
    /// How it is trained.
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

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str =
        "Autoencoder over the external torques of one sample (Tajiri and Iwamoto).";
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
    Ok(Box::new(VectorScorer::load(trained, Autoencoder::load)?))
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
    let units = !settings.layers.contains(&0);
    learned::demand(NAME, units, "every one of `layers` must be at least 1")?;
    settings.training.check(NAME)?;
    let course = Course::new(NAME, &settings.signals, WINDOW, setup, lessons, seed)?;
    let vectors = Vectors::new(&course, WINDOW, 1);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let net = Autoencoder::fit(&vectors, &settings.layers, &settings.training, &mut rng)
        .map_err(|error| course.failed(error))?;
    course.end(|trained| vectors.save(&net, trained), load)
}
