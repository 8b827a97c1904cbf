//! A recording of a set, with its role and its labelled contacts.

use std::path::PathBuf;

use crate::labels::Truth;

/// Role of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Training.
    Train,
    /// Choice of thresholds.
    Validation,
    /// Scoring.
    Test,
}

impl Role {
    /// Name in labels and tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Validation => "validation",
            Self::Test => "test",
        }
    }
}

/// A recording of the set.
#[derive(Debug, Clone)]
pub struct Named {
    /// The file's stem, unique within the set.
    pub name: String,
    /// Path of the file.
    pub path: PathBuf,
    /// Role in the evaluation.
    pub role: Role,
    /// Stamp of its first joint state, the zero of its relative times \[ns since the epoch\].
    pub start_ns: i64,
    /// Labelled contacts; `None` if the recording has no labels.
    pub truth: Option<Truth>,
}
