//! Errors of an evaluation.

use tauscope_detect::LearnError;
use tauscope_pipeline::build::BuildError;
use tauscope_pipeline::calibrate::CalibrateError;
use tauscope_pipeline::replay::ReplayError;

/// Error that ends an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// A recording that the stages cannot process.
    #[error("{recording}: {source}")]
    Recording {
        /// The recording.
        recording: String,
        /// The cause.
        source: ReplayError,
    },
    /// A failed calibration of the twin.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// A stage that cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A set without recordings for the fit of the twin.
    #[error(
        "twin `{twin}` is fitted on contact-free recordings, and the set names none under `train`; use --twin rigid, or a twin.yaml"
    )]
    NothingToFit {
        /// The twin.
        twin: String,
    },
    /// A recording without efforts.
    #[error(
        "{recording}: no joint state holds efforts, and without them there is nothing to detect; leave it out of the set, or record it with efforts"
    )]
    NoEffort {
        /// The recording.
        recording: String,
    },
    /// No contact-free sample for which the filters have settled.
    #[error(
        "no threshold can be set: the validation recordings (without them the train recordings) hold no contact-free sample for which the twin's filters have settled"
    )]
    NothingFree,
    /// A detector that cannot learn from this set.
    #[error("{source}")]
    Learn {
        /// The detector.
        detector: &'static str,
        /// The cause.
        source: LearnError,
    },
    /// No detector that can learn from this set.
    #[error("no detector can learn from this set: {why}")]
    NoDetector {
        /// The reason given by each detector.
        why: String,
    },
    /// A detector that was never ready.
    #[error(
        "{detector} was not ready at any sample of the recordings that its threshold is set on"
    )]
    NeverReady {
        /// The detector.
        detector: &'static str,
    },
}

impl EvaluateError {
    /// Whether the error is in the arguments or input files (exit code 2).
    pub fn is_input(&self) -> bool {
        match self {
            Self::Recording { source, .. } => source.is_input(),
            Self::Calibrate(error) => error.is_input(),
            _ => true,
        }
    }
}
