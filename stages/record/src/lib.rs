//! Recorder of the streams: a complete MCAP archive for permanent storage, and a Rerun picture for viewing.

mod archive;
mod around_alarms;
mod config;
mod contacts;
mod error;
mod file_name;
mod files;
mod leftovers;
mod recorder;
mod rerun;
mod retention;
mod room;
mod set_back;
mod streams;
mod words;

pub use config::{AroundAlarms, Config, Keep, RerunConfig, Split};
pub use error::RecordError;
pub use file_name::{FileName, FileNameError};
pub use recorder::Recorder;
pub use rerun::explanation::{
    ExplainedEvent, ExplainedJoint, ExplainedRecording, ExplainedRobot, Explanation,
    write_explanation,
};
pub use streams::{CellInfo, StreamInfo};
pub use tauscope_archive::Compression;
pub use tauscope_archive::whole_file::Existing;

/// Version of Rerun that writes the pictures; a viewer of this version opens them.
pub fn rerun_version() -> String {
    ::rerun::build_info().version.to_string()
}
