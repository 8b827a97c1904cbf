//! Errors of reading and writing recordings.

use std::path::{Path, PathBuf};

use crate::csv_file::CsvError;
use crate::damage::{Damage, seconds};
use crate::lerobot_error::LerobotError;
use crate::parquet_file::ParquetError;
use crate::ros::{DecodeError, EncodeError};
use crate::unreadable::UnreadableJointStates;

/// An error of reading or writing a recording.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// An I/O error.
    #[error("{}", of_io(path, source))]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// A file or folder in none of the supported formats.
    #[error("{}: not a recording ({reason})", path.display())]
    UnknownFormat {
        /// The file or folder.
        path: PathBuf,
        /// Description of the content found instead.
        reason: String,
    },
    /// A file that is corrupt from its first record on.
    #[error("{}: cannot be read from its first record: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
    /// A recording without messages.
    #[error("{}: the recording is empty{}", path.display(), topics_hint(known))]
    Empty {
        /// The recording.
        path: PathBuf,
        /// Topics it declares.
        known: Vec<String>,
    },
    /// A topic that the recording does not have.
    #[error("{}: no topic {topic:?}{}", path.display(), topics_hint(known))]
    NoSuchTopic {
        /// The recording.
        path: PathBuf,
        /// The requested topic.
        topic: String,
        /// Topics it has.
        known: Vec<String>,
    },
    /// A topic without messages.
    #[error("{}: no message on topic {topic:?}", path.display())]
    NoMessages {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
    },
    /// A topic with another type or encoding than expected.
    #[error("{}: topic {topic:?} carries {found}, expected {expected}", path.display())]
    WrongType {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Type and encoding it has.
        found: String,
        /// Type and encoding it should have.
        expected: String,
    },
    /// A topic with joint states in an unsupported encoding.
    #[error("{}: {found}", path.display())]
    UnreadableJointStates {
        /// The recording.
        path: PathBuf,
        /// Topic, type and encoding.
        found: Box<UnreadableJointStates>,
    },
    /// A compressed file or an archive of files.
    #[error("{} is {format}. Unpack it first: `{command}`{}", path.display(), and_others(*others))]
    Compressed {
        /// The file.
        path: PathBuf,
        /// The format, e.g. `a Zstandard-compressed file`.
        format: &'static str,
        /// The shell command that unpacks it.
        command: String,
        /// Number of other compressed files of the same bag.
        others: usize,
    },
    /// A message that cannot be decoded as the type of its topic.
    #[error("{}: topic {topic:?}, log time {} s, at {at}: {source}", path.display(), seconds(*log_time_ns))]
    Decode {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Log time of the message \[ns\].
        log_time_ns: i64,
        /// Position in the file: byte offset (of its chunk, if it is in one), or row.
        at: u64,
        /// The decoding error.
        source: DecodeError,
    },
    /// An unreadable part of the recording. The next read continues behind it.
    #[error("{0}")]
    Damaged(Damage),
    /// Chunks that overlap in time and together exceed the memory limit, so that their messages cannot be sorted.
    #[error(
        "{}: {loaded} bytes of chunks that overlap in time at log time {} s; at most {limit} are held \
         in memory: repair the recording to put it in order",
        path.display(), seconds(*log_time_ns)
    )]
    TooMuchOverlap {
        /// The recording.
        path: PathBuf,
        /// Log time that was reached \[ns\].
        log_time_ns: i64,
        /// Bytes that would be needed.
        loaded: usize,
        /// Bytes allowed.
        limit: usize,
    },
    /// An error in a line of a table.
    #[error(transparent)]
    Csv(Box<CsvError>),
    /// A mapping that does not fit the table.
    #[error("{}: {what}: {reason}", path.display())]
    CsvMapping {
        /// The table.
        path: PathBuf,
        /// The key of the mapping.
        what: String,
        /// Reason why it does not fit.
        reason: String,
    },
    /// A row that cannot be encoded as a message.
    #[error("{}: topic {topic:?}: {source}", path.display())]
    Encode {
        /// The table.
        path: PathBuf,
        /// The topic it appears on.
        topic: String,
        /// Reason.
        source: EncodeError,
    },
    /// A LeRobot data set that cannot be read or used.
    #[error(transparent)]
    Lerobot(Box<LerobotError>),
    /// A Parquet table that cannot be read.
    #[error(transparent)]
    Parquet(Box<ParquetError>),
    /// A database that cannot be read.
    #[error("{}: {source}", path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// SQLite's error.
        source: rusqlite::Error,
    },
}

impl From<LerobotError> for ArchiveError {
    fn from(error: LerobotError) -> Self {
        Self::Lerobot(Box::new(error))
    }
}

impl From<ParquetError> for ArchiveError {
    fn from(error: ParquetError) -> Self {
        Self::Parquet(Box::new(error))
    }
}

impl ArchiveError {
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }

    /// Returns the error text; for a message that cannot be decoded, without its position in the recording.
    pub fn reason(&self) -> String {
        match self {
            Self::Decode { source, .. } => source.to_string(),
            other => other.to_string(),
        }
    }

    /// Returns the damage, if the error is one behind which reading can continue.
    pub fn damage(&self) -> Option<&Damage> {
        match self {
            Self::Damaged(damage) => Some(damage),
            _ => None,
        }
    }
}

fn and_others(others: usize) -> String {
    match others {
        0 => String::new(),
        1 => ", and likewise 1 other file of the bag".to_owned(),
        others => format!(", and likewise {others} other files of the bag"),
    }
}

fn topics_hint(known: &[String]) -> String {
    if known.is_empty() {
        "; it has no topics".to_owned()
    } else {
        format!("; it has {}", known.join(", "))
    }
}

/// Describes an I/O error; the common kinds have their own wording.
fn of_io(path: &Path, source: &std::io::Error) -> String {
    let path = path.display();
    match source.kind() {
        std::io::ErrorKind::NotFound => format!("there is no file or folder {path}"),
        std::io::ErrorKind::PermissionDenied => {
            format!("{path} may not be read or written by this user")
        }
        _ => format!("{path}: {source}"),
    }
}
