//! Trade-off curves of the thresholds of a tuned detector.

/// The two curves in the paper's discussion.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweeps {
    /// Detection over `F_th`, ascending.
    pub detection: Vec<ThresholdSweep>,
    /// Classification over γ (or the detector's other bound between the kinds), ascending.
    pub class: Vec<ClassSweep>,
    /// The tuned `F_th` \[N\].
    pub force_threshold_n: f64,
    /// The tuned γ.
    pub bound: f64,
}

/// Detection results of a force threshold on the tuning recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThresholdSweep {
    /// `F_th` \[N\].
    pub force_threshold_n: f64,
    /// Results for collisions; contacts of unknown kind are treated as collisions.
    pub collisions: FoundSweep,
    /// Results for cooperations.
    pub cooperations: FoundSweep,
    /// Number of detections without a contact.
    pub false_alarms: usize,
}

/// Detection results for one kind of contact.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FoundSweep {
    /// Number of detected contacts.
    pub found: usize,
    /// Number of missed contacts.
    pub missed: usize,
    /// Mean delay from the start of a contact to its detection \[s\]; NaN if none was detected.
    pub mean_delay_s: f64,
}

/// Classification results of a bound between the kinds, on the detected contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassSweep {
    /// Bound below which a contact is a collision.
    pub bound: f64,
    /// Share of cooperations that are classified as such.
    pub sensitivity: f64,
    /// Share of collisions that are classified as such.
    pub specificity: f64,
}
