//! What stays of the streams: the MCAP archive, complete and for ever, and the Rerun picture, to
//! look at.

mod archive;
mod config;
mod error;
mod recorder;
mod rerun;
mod streams;
mod words;

pub use config::{Config, RerunConfig};
pub use error::RecordError;
pub use recorder::Recorder;
pub use streams::{CellInfo, StreamInfo};
pub use tauscope_archive::Compression;
