//! Step 7, report: findings as sentences, with intervals and alternatives, and the test on held-out recordings.
//!
//! In: the explanation of step 6. Out: a [`schema::Report`] (written as `report.json`), the same as a page (crate
//! `tauscope-report`), the corrected twin, and its predictions for the held-out recordings, to which no parameter was
//! fitted (Hastie, Tibshirani and Friedman, *The Elements of Statistical Learning*, 2009, section 7.2). Equally
//! likely alternatives are reported with the motion that would distinguish them.

pub(crate) mod corrected_twin;
pub(crate) mod findings;
pub(crate) mod holdout;
pub(crate) mod locate;
mod look_at;
pub(crate) mod next_motion;
pub(crate) mod notes;
pub(crate) mod remainder;
pub(crate) mod schema;
pub(crate) mod sentences;
pub mod slip_words;
pub(crate) mod slips;
pub(crate) mod summary;
pub(crate) mod verdict;
pub(crate) mod without_law;

pub use look_at::look_at;
pub use next_motion::MOTION_PREFIX;
pub use schema::*;
pub use sentences::{UNCHANGED, error_left, in_units};
