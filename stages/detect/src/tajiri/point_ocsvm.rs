//! `point_ocsvm`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 3.
//!
//! A one-class support vector machine with a Gaussian kernel over the external torques that the momentum
//! observer sees at one sample, scaled by equation 8, ν = 0.1. The score is
//! `ρ - Σ α_i k(x_i, x)`: positive outside of the boundary that holds all but a share ν of the training data.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::frame::{
    ConfigError, Detector, DetectorSettings, LearnError, Lessons, Setup, SignalSettings, Suits,
    Task, Trained, TrainedError, Training,
};
use crate::tajiri::learned::{self, Course, OneClass, Scorer, VectorScorer, Vectors};

/// Canonical name.
pub(crate) const NAME: &str = "point_ocsvm";

/// Samples that a score rests on.
const WINDOW: usize = 1;

/// Settings of `point_ocsvm`. All but `model` are those of its training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The trained detector, a file that `tauscope evaluate` wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<PathBuf>,
    /// The signals it sees.
    pub signals: SignalSettings,
    /// Upper bound of the share of training data outside of the boundary.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub nu: f64,
    /// It is trained on a sample every so many samples.
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

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str = "One-class support vector machine over the external torques of one sample (Tajiri and Iwamoto).";
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::NewPaths;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        learned::build(NAME, setup, load)
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        let trained = train(self, task.setup, &task.lessons, task.seed)?;
        Ok((self.clone(), Some(trained)))
    }

    fn largest_score(trained: &Trained) -> Option<f64> {
        OneClass::largest_score(trained)
    }

    fn found_by_evaluation(&self) -> Vec<&'static str> {
        self.model.iter().map(|_| "model").collect()
    }

    fn trained_file(&mut self) -> Option<&mut Option<PathBuf>> {
        Some(&mut self.model)
    }
}

fn load(trained: &Trained) -> Result<Box<dyn Scorer>, TrainedError> {
    Ok(Box::new(VectorScorer::load(trained, OneClass::load)?))
}

/// Trains it on the contact-free part of the training recordings. Nothing in it is
/// random: `seed` is only noted.
///
/// # Errors
/// If there is no robot's model or too little data.
pub fn train(
    settings: &Settings,
    setup: &Setup,
    lessons: &Lessons<'_>,
    seed: u64,
) -> Result<Trained, LearnError> {
    let share = settings.nu > 0.0 && settings.nu <= 1.0;
    learned::demand(NAME, share, "`nu` must be above 0 and at most 1")?;
    learned::demand(NAME, settings.stride > 0, "`stride` must be at least 1")?;
    let course = Course::new(NAME, &settings.signals, WINDOW, setup, lessons, seed)?;
    let vectors = Vectors::new(&course, WINDOW, settings.stride);
    let machine = OneClass::fit(vectors.rows(), vectors.dimensions(), settings.nu);
    course.end(|trained| vectors.save(&machine, trained), load)
}
