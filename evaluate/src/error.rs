//! Why an evaluation gives nothing.

use tauscope_detect::LearnError;
use tauscope_pipeline::build::BuildError;
use tauscope_pipeline::calibrate::CalibrateError;
use tauscope_pipeline::replay::ReplayError;

/// Why an evaluation gives nothing.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// A recording cannot be run through the stages.
    #[error("{recording}: {source}")]
    Recording {
        /// The recording.
        recording: String,
        /// Why.
        source: ReplayError,
    },
    /// The twin cannot be calibrated.
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    /// A stage cannot be built.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// No recordings to fit the twin on.
    #[error(
        "twin `{twin}` is fitted on contact-free recordings, and the set names none under `train`; use --twin rigid, or a twin.yaml"
    )]
    NothingToFit {
        /// The twin.
        twin: String,
    },
    /// A recording of motion alone.
    #[error(
        "{recording}: no joint state holds efforts, and without them there is nothing to detect; leave it out of the set, or record it with efforts"
    )]
    NoEffort {
        /// The recording.
        recording: String,
    },
    /// Every sample is in a contact, or before the filters have settled.
    #[error(
        "the validation recordings (the train recordings, if there are none) hold no sample in which nothing touches the robot and the twin's filters have settled: no threshold can be set"
    )]
    NothingFree,
    /// A detector cannot learn from this set.
    #[error("{source}")]
    Learn {
        /// The detector.
        detector: &'static str,
        /// Why.
        source: LearnError,
    },
    /// Every detector was left out.
    #[error("no detector can learn from this set: {why}")]
    NoDetector {
        /// What each said.
        why: String,
    },
    /// A detector says nothing.
    #[error(
        "{detector} was not ready at any sample of the recordings that its threshold is set on"
    )]
    NeverReady {
        /// The detector.
        detector: &'static str,
    },
}

impl EvaluateError {
    /// Whether the arguments or files are wrong (exit code 2), rather than what happened since.
    pub fn is_input(&self) -> bool {
        match self {
            Self::Recording { source, .. } => source.is_input(),
            Self::Calibrate(error) => error.is_input(),
            _ => true,
        }
    }
}
