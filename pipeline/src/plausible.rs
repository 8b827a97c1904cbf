//! Plausibility findings of a running pipeline, on the joint states of its sources and the samples of its twins.

mod twin;
mod watched;

use tauscope_session::Plausible;

use crate::cell::Cell;

pub use twin::{PlausibleTwin, cutoff_above_half, cutoffs_above_half, recorded_rate_hz};
pub use watched::{Watched, WatchedTwin};

/// Shortest pause that is reported \[ns\].
/// Physical: a contact may begin and end within half a second.
const PAUSE_NS: i64 = 500_000_000;

/// Creates a plausibility check of the joint states of `cell`.
pub fn of_cell(cell: &Cell) -> Plausible {
    Plausible::new(&cell.facts.joint_names, cell.model.as_ref())
}
