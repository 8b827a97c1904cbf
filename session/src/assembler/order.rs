//! Order of the stamps: which state follows, repeats or precedes the newest one.

use std::collections::VecDeque;

use tauscope_bus::{JointArray, MAX_JOINTS};

use super::gather::Whole;

/// Step back of the stamps from which the clock was set back; a smaller one is an out-of-order delivery \[ns\].
/// Physical: networks delay a message by less than half a second, unless the connection is lost.
const JUMP_BACK_NS: i64 = 500_000_000;

/// Stamps that are remembered, to recognise a copy that another relay delivers later.
/// Resolution: memory; half a second at 100 Hz.
const REMEMBERED: usize = 64;

/// Relation of a state to the newest one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Next {
    /// The next one.
    Follows,
    /// The first of a clock that was set back.
    SetBack,
    /// Older.
    Late,
    /// Behind a jump of the stamps, and refused.
    Behind,
    /// A repetition of the newest.
    Repeated,
    /// A repetition of an earlier one.
    Copy,
    /// Another one with the same stamp.
    Stalled,
}

/// The newest state that was taken.
#[derive(Debug)]
pub(super) struct Order {
    newest_ns: Option<i64>,
    /// Position and effort.
    newest: [JointArray; 2],
    /// Whether a jump was refused and the stamps have not caught up.
    is_behind: bool,
    /// Stamp and first position of the newest states \[ns, rad or m\].
    before: VecDeque<(i64, f64)>,
}

impl Default for Order {
    fn default() -> Self {
        Self {
            newest_ns: None,
            newest: [[0.0; MAX_JOINTS]; 2],
            is_behind: false,
            before: VecDeque::with_capacity(REMEMBERED),
        }
    }
}

impl Order {
    /// Relation of `state` to the newest one. A state that follows, or begins anew, becomes the newest. With
    /// `refuses_set_back`, no state begins anew.
    pub fn next(&mut self, state: &Whole, refuses_set_back: bool) -> Next {
        let values = [state.position, state.effort];
        let own = (state.stamp_ns, state.position[0]);
        let jumps = |newest_ns| jumps_back(newest_ns, state.stamp_ns);
        self.is_behind &= self
            .newest_ns
            .is_some_and(|newest_ns| state.stamp_ns <= newest_ns);
        self.is_behind |= refuses_set_back && self.newest_ns.is_some_and(jumps);
        if self.is_behind {
            return Next::Behind;
        }
        let next = match self.newest_ns {
            Some(newest_ns) if state.stamp_ns == newest_ns && self.newest == values => {
                return Next::Repeated;
            }
            Some(newest_ns) if state.stamp_ns == newest_ns => return Next::Stalled,
            Some(newest_ns) if jumps(newest_ns) => Next::SetBack,
            Some(newest_ns) if state.stamp_ns < newest_ns => {
                if self.before.contains(&own) {
                    return Next::Copy;
                }
                self.remember(own);
                return Next::Late;
            }
            _ => Next::Follows,
        };
        self.newest_ns = Some(state.stamp_ns);
        self.newest = values;
        self.remember(own);
        next
    }

    fn remember(&mut self, own: (i64, f64)) {
        if self.before.len() == REMEMBERED {
            self.before.pop_front();
        }
        self.before.push_back(own);
    }
}

/// Whether the clock was set back between two stamps \[ns\].
pub(super) fn jumps_back(before_ns: i64, stamp_ns: i64) -> bool {
    before_ns.saturating_sub(stamp_ns) > JUMP_BACK_NS
}
