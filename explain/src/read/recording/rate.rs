//! Sample rate of a recording.

use super::Recording;

/// Time between two samples above which it is a gap \[s\].
/// Physical: an arm moves with frequencies of up to about 2 Hz, which needs four samples a second.
pub const MAX_GAP_S: f64 = 0.25;

/// Returns the mean time between samples without gaps, so that a pause does not lower the rate \[s\]. If every step
/// is a gap, all are included.
pub fn mean_step_s(time_s: &[f64]) -> f64 {
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let (sum, count) = steps
        .filter(|step| *step <= MAX_GAP_S)
        .fold((0.0, 0), |(sum, count), step| (sum + step, count + 1));
    if count > 0 {
        return sum / f64::from(count);
    }
    let whole = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
    whole / (time_s.len().max(2) - 1) as f64
}

impl Recording {
    /// Returns the number of samples per second, without gaps \[Hz\].
    pub fn rate_hz(&self) -> f64 {
        1.0 / mean_step_s(&self.time_s).max(1e-6)
    }

    /// Whether its samples are held poses: every step is a gap, and the motion between them is unknown.
    pub fn is_of_poses(&self) -> bool {
        mean_step_s(&self.time_s) > MAX_GAP_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_makes_no_recording_slower() {
        let mut time_s: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        time_s.extend((0..1000).map(|k| 90.0 + 0.01 * f64::from(k)));
        assert!((mean_step_s(&time_s) - 0.01).abs() < 1e-9);
        // If every step is a gap, all are included.
        assert!((mean_step_s(&[0.0, 2.0, 4.0]) - 2.0).abs() < 1e-12);
        assert!(mean_step_s(&[]) <= 0.0);
    }
}
