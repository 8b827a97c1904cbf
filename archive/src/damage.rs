//! What of a recording cannot be read.

use std::path::PathBuf;

use serde::Serialize;

/// A part of a recording that cannot be read, and what is known of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Damage {
    /// The file.
    pub path: PathBuf,
    /// Where in the file it begins \[bytes from its start; the row for SQLite\].
    pub at: u64,
    /// What is wrong.
    #[serde(flatten)]
    pub kind: DamageKind,
    /// Log time of the last message that can be read before it, if any \[ns\].
    pub readable_until_ns: Option<i64>,
}

/// What is wrong with a part of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "damage", rename_all = "snake_case")]
pub enum DamageKind {
    /// The file ends before its end was written: its writer died, or it was cut. What follows
    /// `at` is lost, except what a last chunk gives up to the tear.
    #[error("the file is torn off here")]
    TornTail,
    /// A chunk whose content cannot be trusted or unpacked. Its messages are lost.
    #[error("a chunk cannot be read: {reason}")]
    Chunk {
        /// Why.
        reason: String,
        /// Log time from which on messages are lost, as the chunk says \[ns\].
        start_ns: Option<i64>,
        /// Log time up to which \[ns\].
        end_ns: Option<i64>,
    },
    /// A record that makes no sense. Without an index, all that follows is lost.
    #[error("a record cannot be read: {reason}")]
    Record {
        /// Why.
        reason: String,
    },
    /// The index at the end of the file cannot be used. Nothing is lost: the data were read without.
    #[error("the index cannot be used, all data were read without it: {reason}")]
    Index {
        /// Why.
        reason: String,
    },
    /// A database fails while it is read. Rows from here on are lost.
    #[error("the database cannot be read on: {reason}")]
    Database {
        /// What SQLite says.
        reason: String,
    },
    /// A file that the bag lists is not there, or cannot be read from its start.
    #[error("a file of the bag is missing: {reason}")]
    File {
        /// Why.
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
