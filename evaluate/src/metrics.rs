//! Performance figures of an evaluation.

pub mod events;
pub mod numbers;
pub mod samples;
pub mod statistics;

pub use events::Matched;
pub use numbers::{Numbers, Scored};
