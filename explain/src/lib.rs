#![doc = include_str!("../README.md")]

mod context;
mod data;
mod explain;
mod fit;
#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod fixture;
mod inference;
mod measure;
mod outcome;
mod parallel;
mod physics;
mod propose;
mod read;
pub mod report;

pub use explain::explain;
pub use measure::{Measured, Number, measure};
pub use outcome::Outcome;
pub use read::input::Input;
pub use read::recording::{Losses, Recording, RecordingTopics, Series};
pub use read::start::Start;
