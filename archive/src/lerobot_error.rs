//! Errors of LeRobot data sets, with their remedies.

use std::path::{Path, PathBuf};

/// Maximum number of features in an error message.
/// Layout: by eye; no number depends on it.
const SHOWN: usize = 12;

/// An error in a LeRobot data set, with its path.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct LerobotError {
    /// The data set, or a file of it.
    pub path: PathBuf,
    /// The problem.
    pub problem: LerobotProblem,
}

impl LerobotError {
    pub(crate) fn new(path: &Path, problem: LerobotProblem) -> Self {
        Self {
            path: path.to_owned(),
            problem,
        }
    }
}

/// A problem of a LeRobot data set.
#[derive(Debug, Clone, thiserror::Error)]
pub enum LerobotProblem {
    /// A data set without `meta/info.json`.
    #[error(
        "it looks like a LeRobot data set, but there is no meta/info.json, which says what its columns are: download \
         the folder `meta`, too"
    )]
    NoInfo,
    /// A Parquet table outside a data set.
    #[error(
        "a Parquet table is a recording only within its LeRobot data set: no meta/info.json lies in the folders above it"
    )]
    NoSet,
    /// A malformed file of the data set.
    #[error("{0}")]
    Broken(String),
    /// An unsupported version.
    #[error(
        "a LeRobot data set of version {version}; those of 2.0 to 3.0 are read: convert it with the scripts of LeRobot"
    )]
    Version {
        /// The version that it declares.
        version: String,
    },
    /// Several episodes where one recording is required.
    #[error(
        "a LeRobot data set of {count} episodes, each of which is a recording: name one, {} to {}",
        first.display(), last.display()
    )]
    Several {
        /// Number of episodes.
        count: usize,
        /// Path of the first episode.
        first: PathBuf,
        /// Path of the last episode.
        last: PathBuf,
    },
    /// An episode that the data set does not have.
    #[error(
        "there is no episode {number}; it has {count} episodes, from episode_{first:06} to episode_{last:06}"
    )]
    NoEpisode {
        /// Number of the requested episode.
        number: u64,
        /// Number of episodes of the data set.
        count: usize,
        /// Number of the first episode.
        first: u64,
        /// Number of the last episode.
        last: u64,
    },
    /// A data set without episodes.
    #[error("the LeRobot data set has no episodes")]
    Empty,
    /// A missing file of an episode.
    #[error("episode {number} lies in {file}, which is not there: download it, too")]
    NoFile {
        /// The episode.
        number: u64,
        /// Its file, relative to the data set.
        file: String,
    },
    /// A file without the rows of its episode.
    #[error("no row of it has the episode_index {number}{}", held_words(*held))]
    NotInFile {
        /// The episode.
        number: u64,
        /// First episode in the file, if any.
        held: Option<u64>,
    },
    /// An episode whose rows are not contiguous.
    #[error("the rows of episode {number} do not follow each other")]
    Scattered {
        /// The episode.
        number: u64,
    },
    /// A data set without a feature of positions.
    #[error(
        "no feature holds the positions of joints; there are {}: name one in {}, `position: {{names: [FEATURE]}}`",
        list(features), columns_file.display()
    )]
    NoPosition {
        /// The numeric features.
        features: Vec<String>,
        /// Path of the columns file in which to declare it.
        columns_file: PathBuf,
    },
    /// A columns file that does not fit the data set.
    #[error("{what}: {reason}")]
    Columns {
        /// The key.
        what: &'static str,
        /// Reason.
        reason: String,
    },
    /// A row that is not a joint state.
    #[error("row {row} ({feature}): {reason}")]
    Row {
        /// The row of the file, from 0.
        row: u64,
        /// The feature.
        feature: String,
        /// Reason.
        reason: String,
    },
    /// A data set without efforts.
    #[error(
        "the LeRobot data set has no efforts, and without them there is nothing to compare with the expected ones; its \
         features are {}. Record torque or motor current as `observation.effort`. If a feature holds it under another \
         name, name it in {}: `effort: {{names: [FEATURE]}}`",
        list(features), columns_file.display()
    )]
    NoEffort {
        /// The numeric features.
        features: Vec<String>,
        /// Path of the columns file in which to declare it.
        columns_file: PathBuf,
    },
    /// Joints with other names than those of the robot.
    #[error(
        "the LeRobot data set names no {}; its joints are {}. If they are the same joints, write the robot's names in this \
         order in {}: `joints: [NAME, ...]`",
        list(missing), own.join(", "), columns_file.display()
    )]
    Joints {
        /// Joints of the robot that the data set does not name.
        missing: Vec<String>,
        /// Joints that the data set names.
        own: Vec<String>,
        /// Path of the columns file in which to declare it.
        columns_file: PathBuf,
    },
    /// Positions beyond the range of an arm, probably in degrees.
    #[error(
        "joints go to {most:.0} rad, which no arm does: write `degrees: true` in {} if the data set is in degrees, as those \
         of OpenArm are, and `degrees: false` if it is in rad",
        columns_file.display()
    )]
    Degrees {
        /// Largest absolute position.
        most: f64,
        /// Path of the columns file in which to declare it.
        columns_file: PathBuf,
    },
}

fn list(features: &[String]) -> String {
    let more = features.len().saturating_sub(SHOWN);
    let shown = features[..features.len() - more].join(", ");
    match more {
        0 if features.is_empty() => "none".to_owned(),
        0 => shown,
        more => format!("{shown} and {more} more"),
    }
}

fn held_words(held: Option<u64>) -> String {
    held.map_or_else(String::new, |first| format!("; the first has {first}"))
}
