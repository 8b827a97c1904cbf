//! Findings while a pipeline runs: of the joint states of its sources, and of the samples of its twins.

mod twin;
mod watched;

use tauscope_session::Plausible;

use crate::cell::Cell;

pub use twin::{PlausibleTwin, cutoff_above_half, cutoffs_above_half, recorded_rate_hz};
pub use watched::{Watched, WatchedTwin};

/// A pause that is a finding \[ns\].
/// Physical: an arm may have come and gone in half a second.
const PAUSE_NS: i64 = 500_000_000;

/// Findings about the joint states of `cell`; nothing seen yet.
pub fn of_cell(cell: &Cell) -> Plausible {
    Plausible::new(&cell.facts.joint_names, cell.model.as_ref())
}
