//! Why a twin and a recording differ: locate the mismatch, name the physics that was left out, model it and prove it
//! on recordings that were never fitted.

mod data;
mod explain;
mod fit;
mod physics;
mod read;
pub mod report;
mod select;

pub use explain::{Input, Outcome, explain};
pub use physics::start::Start;
pub use read::recording::{Recording, RecordingError, RecordingTopics};
pub use report::html;
