//! What can be wrong with the detector's part of the pipeline file.

use super::trained::TrainedError;

/// What is wrong with a detector's configuration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// Not exactly one detector.
    #[error("a detect stage runs exactly one detector, found {found}")]
    OneDetector {
        /// How many were given.
        found: usize,
    },
    /// A threshold for a detector with rules of its own.
    #[error(
        "{detector} decides by rules of its own: leave `threshold` out and see its own settings"
    )]
    OwnThreshold {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that needs the robot, behind a twin that is a topic alone.
    #[error("{detector} needs the robot's model: give the cell a `robot` (URDF)")]
    NoModel {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that needs torques, where no effort can be turned into one.
    #[error(
        "{detector} needs torques, and of no joint is it known how much effort is 1 N m: give `torque_constants_nm_per_a`"
    )]
    NoTorque {
        /// The detector.
        detector: &'static str,
    },
    /// A sensor without its first bias.
    #[error(
        "{detector} has no `bias`: give the smallest effort that is a collision, joint by joint in URDF order and in the effort's unit, or let `tauscope evaluate` learn it from contact-free recordings"
    )]
    NoBias {
        /// The detector.
        detector: &'static str,
    },
    /// A bias that does not fit.
    #[error("`bias` of {detector} {reason}: give one number above 0 for each joint")]
    Bias {
        /// The detector.
        detector: &'static str,
        /// What is wrong with it, as a clause.
        reason: String,
    },
    /// Learnt state that does not fit.
    #[error(
        "what {detector} has learnt {reason}: leave it out, or remove its file, and let it learn anew"
    )]
    LearntState {
        /// The detector.
        detector: &'static str,
        /// What is wrong with it, as a clause.
        reason: String,
    },
    /// A detector that must have learnt from labelled recordings.
    #[error("{detector} has learnt nothing yet: `tauscope evaluate` tunes it on a labelled set")]
    NotLearnt {
        /// The detector.
        detector: &'static str,
    },
    /// A detector that must be trained, and is not.
    #[error(
        "{detector} must be trained: `tauscope evaluate` does it on a set of recordings; give the file as its `model`"
    )]
    NotTrained {
        /// The detector.
        detector: &'static str,
    },
    /// The trained detector is another one.
    #[error("the `model` of {detector} is a trained {found}")]
    OtherDetector {
        /// The detector in the pipeline file.
        detector: &'static str,
        /// The one in the file.
        found: String,
    },
    /// The trained detector was trained for other joints.
    #[error(
        "the `model` of {detector} was trained for the joints {trained}, but the cell has {cell}: train it for this robot"
    )]
    OtherJoints {
        /// The detector.
        detector: &'static str,
        /// The joints that it was trained for.
        trained: String,
        /// The cell's joints.
        cell: String,
    },
    /// The file of the trained detector is damaged.
    #[error("the `model` of {detector}: {source}")]
    Trained {
        /// The detector.
        detector: &'static str,
        /// What is wrong with it.
        source: TrainedError,
    },
    /// Both kinds of threshold.
    #[error("`threshold` takes either `sigmas` or `score`, not both")]
    TwoThresholds,
    /// The threshold is in standard deviations of a score that nobody has measured.
    #[error(
        "the threshold of {detector} is {sigmas} standard deviations above the mean score of contact-free data, but the twin holds none: run `tauscope calibrate` and give its file as the twin's `model`, or set `threshold: {{score: …}}`"
    )]
    NoStatistics {
        /// The detector.
        detector: &'static str,
        /// The k that was asked for.
        sigmas: f64,
    },
}
