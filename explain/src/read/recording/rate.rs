//! The rate of a recording.

use super::Recording;

/// A longer time between two samples is a gap \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
pub const MAX_GAP_S: f64 = 0.25;

/// Mean time between samples, apart from gaps \[s\]: a pause makes no recording slower. All times count where each is a gap.
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
    /// Samples a second, apart from gaps \[Hz\].
    pub fn rate_hz(&self) -> f64 {
        1.0 / mean_step_s(&self.time_s).max(1e-6)
    }

    /// Whether its samples are poses that were held: each is a gap from the next, and nothing is known of the motion between.
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
        // Of what has gaps alone, all counts.
        assert!((mean_step_s(&[0.0, 2.0, 4.0]) - 2.0).abs() < 1e-12);
        assert!(mean_step_s(&[]) <= 0.0);
    }
}
