//! Why an episode of a data set cannot be read or used, and what to do.

use std::path::{Path, PathBuf};

/// Features that an error lists.
/// Tuned: by eye, for the length of the message.
const SHOWN: usize = 12;

/// Why a LeRobot data set cannot be read or used, and which.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct LerobotError {
    /// The data set, or the file of it.
    pub path: PathBuf,
    /// What is wrong.
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

/// What is wrong with a LeRobot data set.
#[derive(Debug, Clone, thiserror::Error)]
pub enum LerobotProblem {
    /// The file that describes it is not there.
    #[error(
        "it looks like a LeRobot data set, but there is no meta/info.json, which says what its columns are: download \
         the folder `meta`, too"
    )]
    NoInfo,
    /// A Parquet table that lies in no data set.
    #[error(
        "a Parquet table is a recording only within its LeRobot data set: no meta/info.json lies in the folders above it"
    )]
    NoSet,
    /// A file of it makes no sense.
    #[error("{0}")]
    Broken(String),
    /// Of a version whose files are others.
    #[error(
        "a LeRobot data set of version {version}; those of 2.0 to 3.0 are read: convert it with the scripts of LeRobot"
    )]
    Version {
        /// What it says.
        version: String,
    },
    /// Several episodes where one recording is wanted.
    #[error(
        "a LeRobot data set of {count} episodes, each of which is a recording: name one, {} to {}",
        first.display(), last.display()
    )]
    Several {
        /// How many.
        count: usize,
        /// How the first one is named.
        first: PathBuf,
        /// How the last one is named.
        last: PathBuf,
    },
    /// It holds no episode of that number.
    #[error(
        "there is no episode {number}; it has {count} episodes, from episode_{first:06} to episode_{last:06}"
    )]
    NoEpisode {
        /// What was asked for.
        number: u64,
        /// How many there are.
        count: usize,
        /// The first one.
        first: u64,
        /// The last one.
        last: u64,
    },
    /// It holds no episodes.
    #[error("the LeRobot data set has no episodes")]
    Empty,
    /// The file of an episode is not there.
    #[error("episode {number} lies in {file}, which is not there: download it, too")]
    NoFile {
        /// The episode.
        number: u64,
        /// Its file, below the data set.
        file: String,
    },
    /// The rows of an episode are not in its file.
    #[error("no row of it has the episode_index {number}{}", held_words(*held))]
    NotInFile {
        /// The episode.
        number: u64,
        /// One that it has.
        held: Option<u64>,
    },
    /// The rows of an episode do not follow each other.
    #[error("the rows of episode {number} do not follow each other")]
    Scattered {
        /// The episode.
        number: u64,
    },
    /// No feature holds positions.
    #[error(
        "no feature holds the positions of joints; there are {}: name one in {}, `position: {{names: [FEATURE]}}`",
        list(features), columns_file.display()
    )]
    NoPosition {
        /// Features that hold numbers.
        features: Vec<String>,
        /// Where to say it.
        columns_file: PathBuf,
    },
    /// The file of columns does not fit.
    #[error("{what}: {reason}")]
    Columns {
        /// The key.
        what: &'static str,
        /// Why.
        reason: String,
    },
    /// A row is no joint state.
    #[error("row {row} ({feature}): {reason}")]
    Row {
        /// The row of the file, from 0.
        row: u64,
        /// The feature.
        feature: String,
        /// Why.
        reason: String,
    },
    /// There are no efforts.
    #[error(
        "the LeRobot data set has no efforts, and without them there is nothing to compare with the expected ones; its \
         features are {}. Record torque or motor current as `observation.effort`. If a feature holds it under another \
         name, name it in {}: `effort: {{names: [FEATURE]}}`",
        list(features), columns_file.display()
    )]
    NoEffort {
        /// Features that hold numbers.
        features: Vec<String>,
        /// Where to say it.
        columns_file: PathBuf,
    },
    /// The joints have other names than those of the robot.
    #[error(
        "the LeRobot data set names no {}; its joints are {}. If they are the same joints, write the robot's names in this \
         order in {}: `joints: [NAME, ...]`",
        list(missing), own.join(", "), columns_file.display()
    )]
    Joints {
        /// Joints of the robot that it does not name.
        missing: Vec<String>,
        /// Those that it names.
        own: Vec<String>,
        /// Where to say it.
        columns_file: PathBuf,
    },
    /// Positions are in degrees.
    #[error(
        "joints go to {most:.0} rad, which no arm does: write `degrees: true` in {} if the data set is in degrees, as those \
         of OpenArm are, and `degrees: false` if it is in rad",
        columns_file.display()
    )]
    Degrees {
        /// The largest position.
        most: f64,
        /// Where to say it.
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
