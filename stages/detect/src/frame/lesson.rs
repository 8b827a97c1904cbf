//! Training data of a detector: recordings processed by the twin, and the labelled contacts in them.

use std::path::PathBuf;

use tauscope_bus::{TwinState, flags};

use super::setup::Setup;

/// Longest time by which a detection may precede the start of its contact \[ns\].
/// Derived: `TOLERANCE_S` of the evaluation, so that a detector learns from the contacts that count as found there.
pub(crate) const MATCH_BEFORE_NS: i64 = 20_000_000;
/// Longest time by which a detection may follow the end of its contact \[ns\].
/// Derived: `AFTER_S` of the evaluation, likewise.
const MATCH_AFTER_NS: i64 = 150_000_000;

/// The recordings that a detector learns from.
#[derive(Debug, Clone, Copy)]
pub struct Lessons<'a> {
    /// Recordings for training or tuning.
    pub train: &'a [Lesson],
    /// Recordings for the choice of thresholds and for early stopping.
    pub validation: &'a [Lesson],
}

/// A training task: the cell and the data.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// The cell and its twin.
    pub setup: &'a Setup,
    /// Recordings processed by the twin.
    pub lessons: Lessons<'a>,
    /// Duration without contacts at the start of each recording \[s\].
    pub free_first_s: f64,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// One recording processed by the twin.
#[derive(Debug, Clone, Default)]
pub struct Lesson {
    /// Name, for error messages.
    pub name: String,
    /// All samples, in order.
    pub samples: Vec<TwinState>,
    /// Labelled contacts; empty if there was none, `None` if the recording is not labelled.
    pub contacts: Option<Vec<LabelledContact>>,
}

impl Lesson {
    /// Returns whether there is a labelled contact at this instant \[ns since the epoch\].
    pub fn touches(&self, stamp_ns: i64) -> bool {
        let mut contacts = self.contacts.iter().flatten();
        contacts.any(|contact| (contact.on_ns..=contact.off_ns).contains(&stamp_ns))
    }

    /// Returns all samples; the first one has [`flags::RESET`].
    pub(crate) fn anew(&self) -> impl Iterator<Item = TwinState> {
        let mut begin = flags::RESET;
        self.samples.iter().map(move |sample| {
            let mut sample = *sample;
            sample.header.flags |= std::mem::take(&mut begin);
            sample
        })
    }
}

/// A labelled contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelledContact {
    /// First instant \[ns since the epoch\].
    pub on_ns: i64,
    /// Last instant \[ns since the epoch\].
    pub off_ns: i64,
    /// Kind of the contact.
    pub kind: ContactKind,
    /// Whether it is too weak to be counted as detected or missed.
    pub ignore: bool,
}

impl LabelledContact {
    /// Returns whether a detection at this instant \[ns since the epoch\] may belong to the contact. Of several such
    /// contacts, it belongs to the one that started last.
    pub(crate) fn matches(&self, stamp_ns: i64) -> bool {
        (self.on_ns - MATCH_BEFORE_NS..=self.off_ns + MATCH_AFTER_NS).contains(&stamp_ns)
    }
}

/// Kind of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContactKind {
    /// A contact of unspecified kind.
    Contact,
    /// An accidental contact.
    Collision,
    /// An intended contact of a person who guides the robot.
    Cooperation,
}

/// Reason why a detector cannot learn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// Missing labels that the tuning needs.
    #[error(
        "{detector} is tuned on labelled contacts, and {missing}: say in the set's `labels` what touched the robot and of which `kind` it was, collision or cooperation"
    )]
    NoLabels {
        /// The detector.
        detector: &'static str,
        /// The missing labels, as a clause.
        missing: String,
    },
    /// Too little training data.
    #[error("{detector} learns from at least {wanted}, and the recordings hold {found}")]
    TooLittle {
        /// The detector.
        detector: &'static str,
        /// Required amount, e.g. `100 settled samples`.
        wanted: String,
        /// Available amount.
        found: String,
    },
    /// A training setting out of range.
    #[error("{detector} cannot be trained so: {what}")]
    Setting {
        /// The detector.
        detector: &'static str,
        /// Requirement on the setting.
        what: &'static str,
    },
    /// A failure of the training computation.
    #[error("{detector} could not be trained: {reason}")]
    Failed {
        /// The detector.
        detector: &'static str,
        /// The cause.
        reason: String,
    },
    /// A trained detector that cannot be written.
    #[error("the trained detector {} cannot be written: {reason}", path.display())]
    NotKept {
        /// Path of the file.
        path: PathBuf,
        /// The cause.
        reason: String,
    },
    /// Settings that do not fit the cell.
    #[error(transparent)]
    Config(#[from] super::error::ConfigError),
}
