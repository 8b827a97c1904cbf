//! The observer's default gain.

/// The papers' gain \[1/s\].
/// Tuned: by Tajiri and Iwamoto (section IV-B), on their robot.
pub const DEFAULT_GAIN_PER_S: f64 = 100.0;
