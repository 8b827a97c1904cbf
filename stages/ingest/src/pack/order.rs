//! How the stamp of a state follows the one before.

use tauscope_bus::{JointArray, MAX_JOINTS};

use super::gather::Gathered;

/// A stamp this far behind the one before is a clock that was set back; anything less is a message
/// that came too late.
/// Tuned: by hand, on no recorded seeds; not swept.
const JUMP_BACK_NS: i64 = 500_000_000;

/// What a state is to the newest one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// The next one.
    Follows,
    /// The first of a clock that was set back.
    SetBack,
    /// Older.
    Late,
    /// The same again.
    Repeated,
    /// Another one with the same stamp.
    Stalled,
}

/// The newest state that was taken.
#[derive(Debug)]
pub(super) struct Order {
    newest_ns: Option<i64>,
    /// Position and effort.
    newest: [JointArray; 2],
}

impl Default for Order {
    fn default() -> Self {
        Self {
            newest_ns: None,
            newest: [[0.0; MAX_JOINTS]; 2],
        }
    }
}

impl Order {
    /// What `state` is; one that follows, or begins anew, is the newest from here on.
    pub fn next(&mut self, state: &Gathered) -> Next {
        let said = [state.position, state.effort];
        let next = match self.newest_ns.map(|newest| state.stamp_ns - newest) {
            Some(0) if self.newest == said => return Next::Repeated,
            Some(0) => return Next::Stalled,
            Some(step) if step < -JUMP_BACK_NS => Next::SetBack,
            Some(step) if step < 0 => return Next::Late,
            _ => Next::Follows,
        };
        self.newest_ns = Some(state.stamp_ns);
        self.newest = said;
        next
    }
}
