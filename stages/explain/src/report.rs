//! Step 6, report: findings in words, with intervals, rivals and the proof on recordings held out.

pub(crate) mod corrected_twin;
pub(crate) mod findings;
pub(crate) mod holdout;
pub mod html;
pub(crate) mod locate;
pub(crate) mod next_motion;
pub(crate) mod notes;
pub(crate) mod schema;
pub(crate) mod sentences;
pub(crate) mod verdict;

pub use schema::*;
