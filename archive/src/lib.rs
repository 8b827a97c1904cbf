#![doc = include_str!("../README.md")]

mod bag_folder;
mod chunks;
mod compressed;
mod csv_file;
mod cursor;
mod damage;
mod error;
mod fields;
mod file_kind;
mod info;
mod joint_facts;
mod lerobot;
mod lerobot_error;
mod mcap_file;
mod mcap_write;
mod parquet_file;
mod recording;
mod repair;
pub mod ros;
mod ros1_bag;
mod ros1_convert;
mod sqlite_file;
mod topic;
mod undecodable;
mod unreadable;
pub mod whole_file;

pub use csv_file::{Column, Columns, CsvError, CsvMapping, CsvProblem, limits as csv_limits};
pub use damage::{Damage, DamageKind};
pub use error::ArchiveError;
pub use file_kind::file_kind;
pub use info::{Gap, Info, JointsInfo, TopicInfo};
pub use joint_facts::{FIELDS, FieldTally, JointFacts, JointTallies, Jump, NotFinite, Twice};
pub use lerobot_error::{LerobotError, LerobotProblem};
pub use mcap_write::{
    CHUNK_SPAN_NS, Compression, McapWriter, PROVENANCE, TopicWriter, WriteError, Written,
};
pub use parquet_file::{ParquetError, ParquetProblem};
pub use recording::{
    JointStates, Message, Messages, Recording, RecordingKind, Sources, Stamped, is_there, name_of,
    recordings_at, sources,
};
pub use repair::{
    RepairError, Repaired, RepairedFolder, repair, repair_folder, repair_in_place,
    repaired_folder_path, repaired_path,
};
pub use topic::Topic;
pub use undecodable::Undecodable;
pub use unreadable::UnreadableJointStates;
