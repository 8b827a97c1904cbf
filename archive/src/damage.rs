//! Unreadable parts of a recording.

use std::path::PathBuf;

use serde::Serialize;

/// An unreadable part of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// The file.
    pub path: PathBuf,
    /// Start of the damage in the file \[byte offset; row of a SQLite database; line of a CSV table\].
    pub at: u64,
    /// Kind of damage.
    #[serde(flatten)]
    pub kind: DamageKind,
    /// Log time of the last message that can be read before it, if any \[ns\].
    pub readable_until_ns: Option<i64>,
}

/// Kind of damage to a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "damage", rename_all = "snake_case")]
pub enum DamageKind {
    /// A truncated file: its writer crashed, or the file was cut. Everything after [`Damage::at`] is lost, except the
    /// messages recovered from an incomplete last chunk.
    #[error("the file is torn off here")]
    TornTail,
    /// A chunk whose content is corrupt or cannot be decompressed. Its messages are lost.
    #[error("a chunk cannot be read: {reason}")]
    Chunk {
        /// Reason.
        reason: String,
        /// Log time of the first lost message, as declared by the chunk \[ns\].
        start_ns: Option<i64>,
        /// Log time of the last lost message, as declared by the chunk \[ns\].
        end_ns: Option<i64>,
    },
    /// A malformed record. Without an index, everything after it is lost.
    #[error("a record cannot be read: {reason}")]
    Record {
        /// Reason.
        reason: String,
    },
    /// An unusable index at the end of the file. Nothing is lost: the data were read without it.
    #[error("the index cannot be used, all data were read without it: {reason}")]
    Index {
        /// Reason.
        reason: String,
    },
    /// A database that fails while it is read. Rows from here on are lost.
    #[error("the database cannot be read on: {reason}")]
    Database {
        /// SQLite's error message.
        reason: String,
    },
    /// A file that the bag lists and that is missing, or unreadable from its start.
    #[error("a file of the bag is missing: {reason}")]
    File {
        /// Reason.
        reason: String,
    },
}

impl Damage {
    /// Whether messages are lost, so that a program should end with "data was lost".
    pub fn loses_data(&self) -> bool {
        !matches!(self.kind, DamageKind::Index { .. })
    }
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self {
            path,
            at,
            kind,
            readable_until_ns,
        } = self;
        write!(f, "{} at {at}: {kind}", path.display())?;
        if let Some(ns) = readable_until_ns {
            write!(f, "; readable until {} s", seconds(*ns))?;
        }
        Ok(())
    }
}

/// Nanoseconds as seconds with all digits.
pub(crate) fn seconds(ns: i64) -> String {
    let sign = if ns < 0 { "-" } else { "" };
    let ns = ns.unsigned_abs();
    format!("{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
}
