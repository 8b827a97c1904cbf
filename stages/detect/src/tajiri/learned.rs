//! Common parts of the five learned methods of Tajiri and Iwamoto (section IV-B, 3 to 7): the input
//! signals, the scaling of equation 8, the support vector machine, the networks and their training, and
//! the file of a trained detector ([`crate::Trained`]).
//!
//! The support vector machine is that of libsvm-rs. Networks are trained by [`mod@training`] on whole batches. The
//! inference of a trained network is implemented separately, one sample at a time; tests compare the two.

mod autoencoder;
mod lstm;
mod one_class;
mod runner;
mod scaling;
mod signals;
mod training;
mod vectors;

use std::fmt::Debug;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize};

use crate::frame::{
    ConfigError, Detector, DetectorSettings, LearnError, ScoreUnit, Setup, Suits, Task, Trained,
    Training,
};

pub(crate) use autoencoder::Autoencoder;
pub(crate) use lstm::Lstm;
pub(crate) use one_class::OneClass;
pub(crate) use runner::Load;

/// Settings of a trained detector. All settings except the file of its weights apply only to its training.
pub(crate) trait TrainedSettings: Clone + Default {
    /// Canonical name.
    const NAME: &'static str;
    /// Description in one sentence.
    const ABOUT: &'static str;
    /// Whether its training is random.
    const RANDOM: bool;
    /// Unit of its score.
    const SCORE_UNIT: ScoreUnit = ScoreUnit::None;
    /// Reads the scorer from a trained detector.
    const LOAD: Load;

    /// Returns the setting with the path of the trained detector, a file that `tauscope evaluate` wrote.
    fn model(&mut self) -> &mut Option<PathBuf>;

    /// Trains it on the contact-free part of the training recordings.
    ///
    /// # Errors
    /// If there is no robot's model, too little data, or the training diverges.
    fn train(&self, task: &Task<'_>) -> Result<Trained, LearnError>;

    /// Returns the window length \[samples\], if it judges windows.
    fn window(&self) -> Option<usize> {
        None
    }

    /// Returns an upper bound of its score on any input, if there is one.
    fn largest_score(_trained: &Trained) -> Option<f64> {
        None
    }

    /// Returns the default training settings, if it is a network.
    fn training(&self) -> Option<TrainingSettings> {
        None
    }
}

impl<S> DetectorSettings for S
where
    S: TrainedSettings + Debug + PartialEq + Serialize + DeserializeOwned + JsonSchema,
    S: Send + Sync + 'static,
{
    const NAME: &'static str = <S as TrainedSettings>::NAME;
    const SCORE_UNIT: ScoreUnit = <S as TrainedSettings>::SCORE_UNIT;
    const ABOUT: &'static str = <S as TrainedSettings>::ABOUT;
    const TRAINING: Training = Training::Own;
    const RANDOM: bool = <S as TrainedSettings>::RANDOM;
    const SUITS: Suits = Suits::NewPaths;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        runner::build(<S as TrainedSettings>::NAME, setup, S::LOAD)
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        Ok((self.clone(), Some(self.train(task)?)))
    }

    fn window(&self) -> Option<usize> {
        TrainedSettings::window(self)
    }

    fn largest_score(trained: &Trained) -> Option<f64> {
        <S as TrainedSettings>::largest_score(trained)
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        let mut settings = self.clone();
        settings.model().iter().map(|_| "model").collect()
    }

    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(self.model())
    }
}

/// Training of a network: Adam on the mean squared error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrainingSettings {
    /// Number of passes over all training data.
    pub epochs: usize,
    /// Samples or windows in one step.
    pub batch: usize,
    /// Share of each hidden layer's units that is dropped at a step.
    pub dropout: f64,
    /// Adam's step size.
    pub learning_rate: f64,
}

/// Training of a network in the pipeline file; omitted keys have the detector's defaults.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "TrainingSettings")]
pub(crate) struct GivenTraining {
    /// Number of passes over all training data.
    #[schemars(range(min = 1))]
    epochs: Option<usize>,
    /// Samples or windows in one step.
    #[schemars(range(min = 1))]
    batch: Option<usize>,
    /// Share of each hidden layer's units that is dropped at a step.
    #[schemars(range(min = 0.0, max = 0.9))]
    dropout: Option<f64>,
    /// Adam's step size.
    #[schemars(range(min = 1e-9, max = 1.0))]
    learning_rate: Option<f64>,
}

/// Reads the training settings from a file, with the detector's defaults for omitted keys.
pub(crate) fn training<'de, S: TrainedSettings, D: Deserializer<'de>>(
    file: D,
) -> Result<TrainingSettings, D::Error> {
    let given = GivenTraining::deserialize(file)?;
    let own = S::default().training();
    let own = own.ok_or_else(|| serde::de::Error::custom("this detector trains no net"))?;
    Ok(TrainingSettings {
        epochs: given.epochs.unwrap_or(own.epochs),
        batch: given.batch.unwrap_or(own.batch),
        dropout: given.dropout.unwrap_or(own.dropout),
        learning_rate: given.learning_rate.unwrap_or(own.learning_rate),
    })
}

impl TrainingSettings {
    /// Validates the settings.
    pub(crate) fn check(&self, detector: &'static str) -> Result<(), LearnError> {
        demand(detector, self.epochs > 0, "`epochs` must be at least 1")?;
        demand(detector, self.batch > 0, "`batch` must be at least 1")?;
        let share = (0.0..1.0).contains(&self.dropout);
        demand(detector, share, "`dropout` must be from 0 to below 1")?;
        let step = self.learning_rate > 0.0 && self.learning_rate.is_finite();
        demand(detector, step, "`learning_rate` must be above 0")
    }
}

/// Returns an error with the requirement `what` on a setting, unless it is met.
pub(crate) fn demand(
    detector: &'static str,
    is_so: bool,
    what: &'static str,
) -> Result<(), LearnError> {
    if is_so {
        return Ok(());
    }
    Err(LearnError::Setting { detector, what })
}
