//! Errors in the detector's part of the pipeline file.

use super::trained::TrainedError;

/// Error in a detector's configuration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// No detector, or several.
    #[error("a detect stage runs exactly one detector, found {found}")]
    OneDetector {
        /// Number of detectors.
        found: usize,
    },
    /// A threshold for a detector with its own rules.
    #[error(
        "{detector} decides by rules of its own: leave `threshold` out and see its own settings"
    )]
    OwnThreshold {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that needs the robot model, in a cell without one.
    #[error("{detector} needs the robot's model: give the cell a `robot` (URDF)")]
    NoModel {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that needs torques, in a cell where no effort can be converted to one.
    #[error(
        "{detector} needs torques, and of no joint is it known how much effort is 1 N m: give `torque_constants_nm_per_a`"
    )]
    NoTorque {
        /// The detector.
        detector: &'static str,
    },
    /// A virtual collision sensor without an initial bias.
    #[error(
        "{detector} has no `bias`: give the smallest effort that is a collision, joint by joint in URDF order and in the effort's unit, or let `tauscope evaluate` learn it from contact-free recordings"
    )]
    NoBias {
        /// The detector.
        detector: &'static str,
    },
    /// A bias that does not fit the cell.
    #[error("`bias` of {detector} {reason}: give one number above 0 for each joint")]
    Bias {
        /// The detector.
        detector: &'static str,
        /// The mismatch, as a clause.
        reason: String,
    },
    /// A learnt state that does not fit the cell.
    #[error(
        "what {detector} has learnt {reason}: leave it out, or remove its file, and let it learn anew"
    )]
    LearntState {
        /// The detector.
        detector: &'static str,
        /// The mismatch, as a clause.
        reason: String,
    },
    /// A detector that needs to be tuned on labelled recordings, and is not.
    #[error("{detector} has learnt nothing yet: `tauscope evaluate` tunes it on a labelled set")]
    NotLearnt {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that needs to be trained, and is not.
    #[error(
        "{detector} must be trained: `tauscope evaluate` does it on a set of recordings; give the file as its `model`"
    )]
    NotTrained {
        /// The detector.
        detector: &'static str,
    },
    /// The file of another trained detector.
    #[error("the `model` of {detector} is a trained {found}")]
    OtherDetector {
        /// The detector in the pipeline file.
        detector: &'static str,
        /// The detector in the file.
        found: String,
    },
    /// A detector trained for other joints.
    #[error(
        "the `model` of {detector} was trained for the joints {trained}, but the cell has {cell}: train it for this robot"
    )]
    OtherJoints {
        /// The detector.
        detector: &'static str,
        /// The joints for which it was trained.
        trained: String,
        /// The cell's joints.
        cell: String,
    },
    /// A damaged file of a trained detector.
    #[error("the `model` of {detector}: {source}")]
    Trained {
        /// The detector.
        detector: &'static str,
        /// The error in the file.
        source: TrainedError,
    },
    /// Both kinds of threshold.
    #[error("`threshold` takes either `sigmas` or `score`, not both")]
    TwoThresholds,
    /// A threshold in standard deviations of a score that has not been measured.
    #[error(
        "the threshold of {detector} is {sigmas} standard deviations above the mean score of contact-free data, but the twin holds none: run `tauscope calibrate` and give its file as the twin's `model`, or set `threshold: {{score: …}}`"
    )]
    NoStatistics {
        /// The detector.
        detector: &'static str,
        /// The configured number of standard deviations.
        sigmas: f64,
    },
}
