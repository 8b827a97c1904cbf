//! A recording of a set: what it is for, and what touched the robot in it.

use std::path::PathBuf;

use crate::labels::Truth;

/// What a recording is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// To train on.
    Train,
    /// To choose thresholds on.
    Validation,
    /// To be scored.
    Test,
}

impl Role {
    /// As the labels and tables have it.
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
    /// The file's stem, which no other of the set has.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
    /// What it is for.
    pub role: Role,
    /// Stamp of its first joint state \[ns since the epoch\]: where its seconds begin.
    pub start_ns: i64,
    /// What touched the robot; `None` if nobody has said.
    pub truth: Option<Truth>,
}
