//! What a detector learns from: recordings behind the twin, and what touched the robot in them.

use std::path::PathBuf;

use tauscope_bus::{TwinState, flags};

use super::setup::Setup;

/// The recordings that a detector learns from.
#[derive(Debug, Clone, Copy)]
pub struct Lessons<'a> {
    /// Those it is trained or tuned on.
    pub train: &'a [Lesson],
    /// Those that thresholds are chosen on, and training is stopped by.
    pub validation: &'a [Lesson],
}

/// What there is to learn from, and in which cell.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Recordings behind the twin.
    pub lessons: Lessons<'a>,
    /// For so long nothing touches the robot at the beginning of each recording \[s\].
    pub free_first_s: f64,
    /// For what is drawn by chance.
    pub seed: u64,
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

impl Lesson {
    /// Whether a labelled contact lasts at this instant \[ns since the epoch\].
    pub fn touches(&self, stamp_ns: i64) -> bool {
        let mut contacts = self.contacts.iter().flatten();
        contacts.any(|contact| (contact.on_ns..=contact.off_ns).contains(&stamp_ns))
    }

    /// Every sample, the first of them a new beginning.
    pub(crate) fn anew(&self) -> impl Iterator<Item = TwinState> {
        let mut begin = flags::RESET;
        self.samples.iter().map(move |sample| {
            let mut sample = *sample;
            sample.header.flags |= std::mem::take(&mut begin);
            sample
        })
    }
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
    #[error(
        "{detector} is tuned on labelled contacts, and {missing}: say in the set's `labels` what touched the robot and of which `kind` it was, collision or cooperation"
    )]
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
    /// A setting of the training is out of range.
    #[error("{detector} cannot be trained so: {what}")]
    Setting {
        /// The detector.
        detector: &'static str,
        /// What the setting must be.
        what: &'static str,
    },
    /// What computes the training failed.
    #[error("{detector} could not be trained: {reason}")]
    Failed {
        /// The detector.
        detector: &'static str,
        /// Why.
        reason: String,
    },
    /// What was trained cannot be written.
    #[error("the trained detector {} cannot be written: {reason}", path.display())]
    NotKept {
        /// Where it should have gone.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// The settings do not fit.
    #[error(transparent)]
    Config(#[from] super::error::ConfigError),
}
