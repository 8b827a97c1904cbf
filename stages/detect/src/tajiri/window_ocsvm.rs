//! `window_ocsvm`: Tajiri and Iwamoto, "Collision Detection for Robot Arm Assisted with Digital Twin
//! System", section IV-B 6.
//!
//! A one-class support vector machine with a Gaussian kernel over the external torques that the momentum
//! observer sees at 16 samples in a row
//! (Park et al. 2021), scaled by equation 8, ν = 0.1. The score is
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
pub(crate) const NAME: &str = "window_ocsvm";

/// Settings of `window_ocsvm`. All but `model` are those of its training.
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
    /// Upper bound of the share of training data outside of the boundary.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub nu: f64,
    /// It is trained on a window every so many samples.
    #[schemars(range(min = 1))]
    pub stride: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            model: None,
            signals: SignalSettings::default(),
            window: 16,
            nu: 0.1,
            // Side by side: the paper trained in 0.19 s, far too short for all windows.
            stride: 16,
        }
    }
}

impl DetectorSettings for Settings {
    const NAME: &'static str = NAME;
    const ABOUT: &'static str = "`point_ocsvm` over windows (after Park et al.).";
    const TRAINING: Training = Training::Own;
    const SUITS: Suits = Suits::NewPaths;

    fn build(&self, setup: &Setup, _hold_s: f64) -> Result<Box<dyn Detector>, ConfigError> {
        learned::build(NAME, setup, load)
    }

    fn learn(&self, task: &Task<'_>) -> Result<(Self, Option<Trained>), LearnError> {
        let trained = train(self, task.setup, &task.lessons, task.seed)?;
        Ok((self.clone(), Some(trained)))
    }

    fn window(&self) -> Option<usize> {
        Some(self.window)
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
    let course = Course::new(
        NAME,
        &settings.signals,
        settings.window,
        setup,
        lessons,
        seed,
    )?;
    let vectors = Vectors::new(&course, settings.window, settings.stride);
    let machine = OneClass::fit(vectors.rows(), vectors.dimensions(), settings.nu);
    course.end(|trained| vectors.save(&machine, trained), load)
}
