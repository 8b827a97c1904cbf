//! Windows over which the residual is averaged.

/// Lengths of the windows \[s\]; the last window is used only if it reduces the noise enough.
/// Chosen: from one sample at 100 Hz to below the correlation time of the residual (0.5 s). In white noise a contact
/// between two windows loses at most 26 % of its signal-to-noise ratio. Coarser steps lose more, finer ones cost
/// computing time.
pub(crate) const WINDOWS_S: [f64; 4] = [0.01, 0.03, 0.1, 0.2];
/// Index of the window for the onset of a contact.
pub(crate) const SHORTEST: usize = 0;
/// Index of the window with which a contact is followed.
pub(crate) const MIDDLE: usize = 1;
/// Index of the window for the present residual without a contact.
pub(super) const LONG: usize = 2;

/// Settings for the slow part of a residual: drift and offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Follow {
    /// Time constant of the drift \[s\].
    pub drift_s: f64,
    /// Duration at the beginning whose mean residual is the offset \[s\]; 0 for no offset.
    pub offset_from_first_s: f64,
}
