//! What a detector learns from: recordings behind the twin, and what touched the robot in them.

use tauscope_bus::TwinState;

/// The recordings that a detector learns from.
#[derive(Debug, Clone, Copy)]
pub struct Lessons<'a> {
    /// Those it is trained or tuned on.
    pub train: &'a [Lesson],
    /// Those that thresholds are chosen on, and training is stopped by.
    pub validation: &'a [Lesson],
}

/// One recording behind the twin.
#[derive(Debug, Clone, Default)]
pub struct Lesson {
    /// Its name, for errors.
    pub name: String,
    /// Every sample, in order.
    pub samples: Vec<TwinState>,
    /// What touched the robot; empty if nothing did, `None` if nobody has said.
    pub contacts: Option<Vec<LabelledContact>>,
}

/// A contact that somebody labelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelledContact {
    /// First instant \[ns since the epoch\].
    pub on_ns: i64,
    /// Last instant \[ns since the epoch\].
    pub off_ns: i64,
    /// What it was.
    pub kind: ContactKind,
    /// Too weak to be counted either way.
    pub ignore: bool,
}

/// What a contact was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactKind {
    /// Nobody has said which.
    Contact,
    /// By accident.
    Collision,
    /// By the will of somebody who leads the robot.
    Cooperation,
}

/// Why a detector cannot learn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// Labels that its tuning needs are missing.
    #[error("{detector} is tuned on labelled contacts, and {missing}")]
    NoLabels {
        /// The detector.
        detector: &'static str,
        /// What is missing, as a clause.
        missing: String,
    },
    /// Too little to learn from.
    #[error("{detector} learns from at least {wanted}, and the recordings hold {found}")]
    TooLittle {
        /// The detector.
        detector: &'static str,
        /// How much is wanted, e.g. `100 settled samples`.
        wanted: String,
        /// How much there is.
        found: String,
    },
    /// The settings do not fit.
    #[error(transparent)]
    Config(#[from] crate::ConfigError),
}
