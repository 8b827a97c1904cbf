//! Step 1, read: recordings as columns of numbers, and whether they allow a verdict at all.

pub mod audit;
pub mod input;
pub mod recording;
pub mod start;
