//! Step 6, report: findings in words, with intervals, rivals and the proof on recordings held out.

pub mod findings;
pub mod holdout;
pub mod html;
pub mod locate;
pub mod next_motion;
mod schema;
pub mod sentences;
pub mod verdict;

pub use schema::*;
