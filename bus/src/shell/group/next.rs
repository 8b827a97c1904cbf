//! The time at which a group is to be called again.

use std::time::Instant;

/// When a group has something to do again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// At once.
    Now,
    /// At this time.
    At(Instant),
    /// When one of its sources or links has samples again.
    Woken,
    /// Never: all its nodes have ended.
    Over,
}

impl Next {
    /// The earlier of two.
    pub(super) fn or(self, other: Self) -> Self {
        match (self, other) {
            (Self::Now, _) | (_, Self::Now) => Self::Now,
            (Self::At(one), Self::At(other)) => Self::At(one.min(other)),
            (Self::At(at), _) | (_, Self::At(at)) => Self::At(at),
            (Self::Woken, _) | (_, Self::Woken) => Self::Woken,
            (Self::Over, Self::Over) => Self::Over,
        }
    }
}
