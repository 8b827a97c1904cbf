//! White noise of a signal, estimated from its fourth differences.

use crate::read::recording::Recording;

/// Median of the absolute value of a normal variable, in standard deviations.
/// Statistical: the 75 % quantile of the standard normal distribution.
pub const MEDIAN_OF_ABS_NORMAL: f64 = 0.6745;
/// Variance of the fourth difference of white noise with variance 1.
/// Statistical: the sum of the squared coefficients, 1 + 16 + 36 + 16 + 1.
const FOURTH_DIFFERENCE_VARIANCE: f64 = 70.0;
/// Estimates the variance of the white noise on a smooth signal from its fourth differences, robust against jumps.
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

/// Estimates the variance of the white noise on an effort, and the share of its samples that are new.
///
/// A driver may repeat an effort until it has a new one, or quantise it coarsely. Then most differences are zero and
/// carry no information on the noise. So repeated samples are left out, and the variance of the quantisation error is
/// a lower bound.
pub fn of_effort(signal: &[f64]) -> (f64, f64) {
    let mut new = signal.to_vec();
    new.dedup();
    if 2 * new.len() > signal.len() {
        return (white_variance(signal), 1.0);
    }
    let steps = new.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let step = steps.fold(f64::INFINITY, f64::min);
    let of_step = if step.is_finite() {
        step * step / 12.0
    } else {
        0.0
    };
    let share = new.len() as f64 / signal.len().max(1) as f64;
    (white_variance(&new).max(of_step), share)
}

/// Estimates the standard deviation of the white noise on a joint's measured effort \[effort unit\]. NaN for
/// recordings of poses, whose differences are caused by gravity.
pub fn white_noise(recordings: &[Recording], joint: usize, n: usize) -> f64 {
    let mut all: Vec<f64> = recordings
        .iter()
        .filter(|recording| !recording.is_of_poses())
        .map(|recording| {
            let signal: Vec<f64> = recording
                .effort
                .iter()
                .skip(joint)
                .step_by(n)
                .copied()
                .collect();
            of_effort(&signal).0.sqrt()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Noise;

    /// Effort of a slow motion with noise of 0.1, each value repeated `times` times.
    fn told(times: usize) -> Vec<f64> {
        let mut noise = Noise(5);
        let of = |k: usize| (0.02 * k as f64).sin() + 0.1 * noise.next();
        let values: Vec<f64> = (0..2000).map(of).collect();
        let each = values.iter();
        each.flat_map(|value| std::iter::repeat_n(*value, times))
            .collect()
    }

    #[test]
    fn an_effort_that_is_told_ten_times_has_the_noise_of_one_that_is_told_once() {
        let ((once, all), (often, few)) = (of_effort(&told(1)), of_effort(&told(10)));
        assert!((once.sqrt() - 0.1).abs() < 0.01, "{once}");
        assert!((often / once - 1.0).abs() < 1e-9, "{often}");
        assert!(all > 0.999 && (few - 0.1).abs() < 1e-9, "{few}");
    }

    #[test]
    fn a_step_hides_what_is_smaller() {
        let coarse = |k: usize| (0.01 * k as f64).floor() * 0.5;
        let signal: Vec<f64> = (0..2000).map(coarse).collect();
        assert!((of_effort(&signal).0 - 0.25 / 12.0).abs() < 1e-12);
        assert!(of_effort(&[3.0; 100]).0 <= 0.0);
    }
}
