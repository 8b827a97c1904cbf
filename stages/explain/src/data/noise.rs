//! White noise of a signal, estimated from its fourth differences.

use crate::read::recording::Recording;

/// Median of the absolute value of a normal variable, in standard deviations.
/// Statistical: the 75 % quantile of the standard normal distribution.
const MEDIAN_OF_ABS_NORMAL: f64 = 0.6745;
/// Variance of the fourth difference of white noise with variance 1.
/// Statistical: the sum of the squared coefficients, 1 + 16 + 36 + 16 + 1.
const FOURTH_DIFFERENCE_VARIANCE: f64 = 70.0;

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
    let deviation = squares[squares.len() / 2] / MEDIAN_OF_ABS_NORMAL;
    deviation * deviation / FOURTH_DIFFERENCE_VARIANCE
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
