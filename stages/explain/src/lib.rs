//! Why a twin and a recording differ: locate the mismatch, name the physics that was left out, model it and prove it
//! on recordings that were never fitted.

mod context;
mod data;
mod explain;
mod fit;
mod outcome;
mod physics;
mod read;
pub mod report;
mod select;

pub use explain::explain;
pub use outcome::Outcome;
pub use read::input::Input;
pub use read::recording::{Recording, RecordingError, RecordingTopics};
pub use read::start::Start;
pub use report::html;
