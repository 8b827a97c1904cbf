//! Why a recording cannot be read or written.

use std::path::{Path, PathBuf};

use crate::csv_file::CsvError;
use crate::damage::{Damage, seconds};
use crate::lerobot_error::LerobotError;
use crate::parquet_file::ParquetError;
use crate::ros::{DecodeError, EncodeError};
use crate::unreadable::UnreadableJointStates;

/// Why a recording cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The operating system refuses.
    #[error("{}", of_io(path, source))]
    Io {
        /// The file.
        path: PathBuf,
        /// What it says.
        source: std::io::Error,
    },
    /// None of the formats that can be read.
    #[error("{}: not a recording ({reason})", path.display())]
    UnknownFormat {
        /// The file or folder.
        path: PathBuf,
        /// What was found instead.
        reason: String,
    },
    /// Broken from its first record on.
    #[error("{}: cannot be read from its first record: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// There is a recording, but no message in it.
    #[error("{}: the recording is empty{}", path.display(), topics_hint(known))]
    Empty {
        /// The recording.
        path: PathBuf,
        /// Topics it declares.
        known: Vec<String>,
    },
    /// The topic is not in the recording.
    #[error("{}: no topic {topic:?}{}", path.display(), topics_hint(known))]
    NoSuchTopic {
        /// The recording.
        path: PathBuf,
        /// What was asked for.
        topic: String,
        /// Topics it has.
        known: Vec<String>,
    },
    /// The topic is there, but holds no message.
    #[error("{}: no message on topic {topic:?}", path.display())]
    NoMessages {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
    },
    /// The topic carries another type.
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
    /// The topic carries joint states in an encoding that cannot be read.
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
    /// A message is not what its topic says.
    #[error("{}: topic {topic:?}, log time {} s, at {at}: {source}", path.display(), seconds(*log_time_ns))]
    Decode {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Log time of the message \[ns\].
        log_time_ns: i64,
        /// Where it lies: bytes from the start of the file (of its chunk, if it is in one), or row.
        at: u64,
        /// What is wrong with it.
        source: DecodeError,
    },
    /// A part of the recording cannot be read. The reader goes on behind it if it is asked again.
    #[error("{0}")]
    Damaged(Damage),
    /// Chunks overlap so much in time that they cannot be put in order within the memory allowed.
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
    /// A line of a table is broken.
    #[error(transparent)]
    Csv(Box<CsvError>),
    /// The mapping does not fit the table.
    #[error("{}: {what}: {reason}", path.display())]
    CsvMapping {
        /// The table.
        path: PathBuf,
        /// The key of the mapping.
        what: String,
        /// Why it does not fit.
        reason: String,
    },
    /// A row cannot be made into a message.
    #[error("{}: topic {topic:?}: {source}", path.display())]
    Encode {
        /// The table.
        path: PathBuf,
        /// The topic it appears on.
        topic: String,
        /// Why.
        source: EncodeError,
    },
    /// A LeRobot data set cannot be read, or not be used.
    #[error(transparent)]
    Lerobot(Box<LerobotError>),
    /// A Parquet table cannot be read.
    #[error(transparent)]
    Parquet(Box<ParquetError>),
    /// A database cannot be read.
    #[error("{}: {source}", path.display())]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// What SQLite says.
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

    /// The fault, without the place in the file where it is known.
    pub fn reason(&self) -> String {
        match self {
            Self::Decode { source, .. } => source.to_string(),
            other => other.to_string(),
        }
    }

    /// The damage, if it is that and reading can go on behind it.
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

/// What the operating system says, in words where there are better ones.
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
