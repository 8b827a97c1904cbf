//! What the five learned methods of Tajiri and Iwamoto (section IV-B, 3 to 7) share: the signals they
//! see, equation 8's scaling, the support vector machine, the nets and how they are trained, and the
//! file that a trained detector is kept in ([`Trained`](crate::Trained)).
//!
//! Training uses libsvm-rs and candle. A trained net is run by hand-written loops over its weights: for
//! nets this small a framework's bookkeeping costs many times the arithmetic. Tests hold the two against
//! each other.

mod autoencoder;
mod lstm;
mod one_class;
mod runner;
mod scaling;
mod signals;
mod training;
mod vectors;

use crate::frame::LearnError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use autoencoder::Autoencoder;
pub(crate) use lstm::{Lstm, LstmScorer};
pub(crate) use one_class::OneClass;
pub(crate) use runner::{Course, Scorer, build};
pub(crate) use vectors::{VectorScorer, Vectors};

/// How a net is trained: Adam on the mean squared error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrainingSettings {
    /// How often all training data is gone through.
    pub epochs: usize,
    /// Samples or windows in one step.
    pub batch: usize,
    /// Share of each middle layer's units that is left out at a step.
    pub dropout: f64,
    /// Adam's step size.
    pub learning_rate: f64,
}

/// The same as files have it: what is left out is the detector's own.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(rename = "TrainingSettings")]
pub(crate) struct GivenTraining {
    /// How often all training data is gone through.
    #[schemars(range(min = 1))]
    epochs: Option<usize>,
    /// Samples or windows in one step.
    #[schemars(range(min = 1))]
    batch: Option<usize>,
    /// Share of each middle layer's units that is left out at a step.
    #[schemars(range(min = 0.0, max = 0.9))]
    dropout: Option<f64>,
    /// Adam's step size.
    #[schemars(range(min = 1e-9, max = 1.0))]
    learning_rate: Option<f64>,
}

impl GivenTraining {
    /// What is given, and `own` in the place of what is not.
    pub fn or(self, own: TrainingSettings) -> TrainingSettings {
        TrainingSettings {
            epochs: self.epochs.unwrap_or(own.epochs),
            batch: self.batch.unwrap_or(own.batch),
            dropout: self.dropout.unwrap_or(own.dropout),
            learning_rate: self.learning_rate.unwrap_or(own.learning_rate),
        }
    }
}

impl TrainingSettings {
    /// Refuses what cannot be trained with.
    pub(crate) fn check(&self, detector: &'static str) -> Result<(), LearnError> {
        demand(detector, self.epochs > 0, "`epochs` must be at least 1")?;
        demand(detector, self.batch > 0, "`batch` must be at least 1")?;
        let share = (0.0..1.0).contains(&self.dropout);
        demand(detector, share, "`dropout` must be from 0 to below 1")?;
        let step = self.learning_rate > 0.0 && self.learning_rate.is_finite();
        demand(detector, step, "`learning_rate` must be above 0")
    }
}

/// An error that says what a setting must be, unless it is so.
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
