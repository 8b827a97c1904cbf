//! Over which lengths of time the residual is looked at.

/// Lengths of the windows \[s\]; the last one is used where it pays.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
pub(crate) const WINDOWS_S: [f64; 4] = [0.01, 0.03, 0.1, 0.2];
/// The window that tells how a contact begins.
pub(crate) const SHORTEST: usize = 0;
/// The window that a contact is followed by.
pub(crate) const MIDDLE: usize = 1;
/// The window that tells what is usual just now.
pub(super) const LONG: usize = 2;

/// How the slow part of a residual is had.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Follow {
    /// Time constant \[s\].
    pub drift_s: f64,
    /// The mean of so much at the beginning \[s\]; 0 for none.
    pub offset_from_first_s: f64,
}
