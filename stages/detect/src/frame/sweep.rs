//! What the thresholds of a detector that was tuned trade against each other.

/// Both curves of the paper's discussion.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweeps {
    /// Over `F_th`, ascending.
    pub detection: Vec<ThresholdSweep>,
    /// Over γ (or what else parts the kinds), ascending.
    pub class: Vec<ClassSweep>,
    /// The tuned `F_th` \[N\].
    pub force_threshold_n: f64,
    /// The tuned γ.
    pub bound: f64,
}

/// What a force threshold finds on the tuning recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThresholdSweep {
    /// `F_th` \[N\].
    pub force_threshold_n: f64,
    /// Collisions and cooperations (contacts of unknown kind count as collisions).
    pub collisions: FoundSweep,
    /// The same of cooperations.
    pub cooperations: FoundSweep,
    /// Detections where nothing touched the robot.
    pub false_alarms: usize,
}

/// What was found of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FoundSweep {
    /// How many were found.
    pub found: usize,
    /// And how many not.
    pub missed: usize,
    /// Mean time from the beginning to the detection \[s\]; NaN if none was found.
    pub mean_delay_s: f64,
}

/// What a bound between the kinds does to the contacts that were found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassSweep {
    /// The bound: below it a contact is a collision.
    pub bound: f64,
    /// Share of cooperations that are told as such.
    pub sensitivity: f64,
    /// Share of collisions that are told as such.
    pub specificity: f64,
}
