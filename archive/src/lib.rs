//! Recordings at rest: MCAP files, rosbag2 bags and CSV tables to messages, and messages to MCAP.
//!
//! [`Recording::open`] finds out what lies at a path. Whatever it is, [`Recording::messages`] gives
//! the messages of chosen topics in the order of their log times, as CDR bytes, with bounded memory:
//! an archive larger than RAM can be read. [`ros`] decodes them. [`McapWriter`] writes what any
//! ROS 2 or Foxglove tool opens.
//!
//! Nothing is lost in silence: what cannot be read is [`Damage`], known when the recording is opened
//! (a torn tail) or told by the reader in its place (a broken chunk).

mod bag_folder;
mod csv_file;
mod cursor;
mod damage;
mod error;
mod info;
mod mcap_file;
mod mcap_write;
mod recording;
mod repair;
pub mod ros;
mod sqlite_file;
mod topic;

pub use csv_file::{Column, Columns, CsvError, CsvMapping, CsvProblem, limits as csv_limits};
pub use damage::{Damage, DamageKind};
pub use error::ArchiveError;
pub use info::{Gap, Info, JointsInfo, TopicInfo};
pub use mcap_write::{
    CHUNK_SPAN_NS, Compression, McapWriter, PROVENANCE, TopicWriter, WriteError, Written,
};
pub use recording::{JointStates, Message, Messages, Recording, RecordingKind, Stamped};
pub use repair::{RepairError, Repaired, repair, repaired_path};
pub use topic::Topic;
