//! White noise of a signal, told from its fourth differences.

use crate::read::recording::Recording;

/// Variance of the white noise on a smooth signal, from its fourth differences, robust against jumps.
pub fn white_variance(signal: &[f64]) -> f64 {
    let mut squares: Vec<f64> = signal
        .windows(5)
        .map(|x| (x[0] - 4.0 * x[1] + 6.0 * x[2] - 4.0 * x[3] + x[4]).abs())
        .collect();
    if squares.is_empty() {
        return 0.0;
    }
    squares.sort_by(f64::total_cmp);
    // The median of |normal| is 0.6745 standard deviations; 70 = 1 + 16 + 36 + 16 + 1.
    let deviation = squares[squares.len() / 2] / 0.6745;
    deviation * deviation / 70.0
}

/// White noise of the measured effort of a joint \[effort unit\].
pub fn white_noise(recordings: &[Recording], joint: usize, n: usize) -> f64 {
    let mut all: Vec<f64> = recordings
        .iter()
        .map(|recording| {
            let signal: Vec<f64> = recording
                .effort
                .iter()
                .skip(joint)
                .step_by(n)
                .copied()
                .collect();
            white_variance(&signal).sqrt()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}
