//! Where samples come from: recordings, live ROS 2 over Zenoh, the simulated cell.
//!
//! Whatever the source, its messages go through the same packing: joints are brought into the cell's
//! order by name, and each sample takes with it what belongs to its instant. That part is pure; the
//! sources around it do the input, and [`Paced`] holds recorded and simulated samples back until
//! their time has come.

mod archived_twin;
mod config;
mod error;
mod pacing;
mod pack;
mod recorded;
mod setup;
pub mod simulated;
mod sources;
mod zenoh;

pub use archived_twin::{ArchivedTwin, ArchivedTwinTopics};
pub use config::{
    Config, ConfigError, CsvConfig, FileConfig, Keys, Rate, SimulateConfig, Topics, ZenohConfig,
};
pub use error::IngestError;
pub use pacing::Paced;
pub use pack::{PackCounts, PackError};
pub use recorded::RecordedSource;
pub use setup::{Setup, Tool};
pub use sources::{Entry, Opening, SOURCES, SimulatedRobot, SourceSettings, open};
pub use zenoh::{ZenohCounts, ZenohSource};
