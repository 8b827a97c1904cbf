//! Estimate of the measurement noise in the residue, independent of the model. It gives the threshold a margin above
//! the model error that noise alone does not reach within weeks.

use tauscope_dynamics::lowpass::Butterworth2;

/// Margin for noise in the residue, in standard deviations. Gaussian noise after a low-pass of 15 Hz exceeds the
/// margin on top of the learnt bias once in some thousand cycles.
/// Statistical: about one in 150 000 samples.
const SIGMAS: f64 = 4.5;
/// Time constant of the estimate \[s\].
/// Chosen: the estimate then has a standard error of 1 % at 500 Hz. With a shorter memory the margin fluctuates, with
/// a longer one it follows a change of the noise late.
const MEMORY_S: f64 = 10.0;
/// Limit at which second differences are clipped, in standard deviations: a collision is not noise.
/// Statistical: Gaussian noise goes beyond three standard deviations once in 370 samples.
const CLIP: f64 = 3.0;
/// Samples between two updates of the estimate. The first block is not clipped, because there is no estimate yet.
/// Resolution: 32 ms at 500 Hz, far below [`MEMORY_S`]; changes the computing time.
const BLOCK: u32 = 16;
/// Ratio of the variance of a second difference of white noise to that of the noise.
/// Statistical: 1² + 2² + 1².
const SECOND_DIFFERENCE: f64 = 6.0;

/// The noise of one joint's currents, from second differences of measured minus expected current. These vanish for
/// smooth signals such as a constant, a ramp or a model error.
#[derive(Debug, Clone)]
pub(super) struct MeasurementNoise {
    /// The low-pass's noise bandwidth \[Hz\].
    bandwidth_hz: f64,
    /// The two previous errors, newest first.
    before: [f64; 2],
    /// Current block: sum of squared second differences, duration \[s\], number of samples.
    sum: f64,
    block_s: f64,
    count: u32,
    /// Time since the start \[s\].
    elapsed_s: f64,
    /// Mean square of second differences, and the largest square that is not clipped.
    square: f64,
    most: f64,
    /// [`SIGMAS`] standard deviations of the noise after the low-pass \[effort unit\].
    margin: f64,
}

impl MeasurementNoise {
    /// Creates the estimate for a low-pass with this cutoff.
    pub fn new(cutoff_hz: f64) -> Self {
        Self {
            bandwidth_hz: Butterworth2::NOISE_BANDWIDTH * cutoff_hz,
            before: [0.0; 2],
            sum: 0.0,
            block_s: 0.0,
            count: 0,
            elapsed_s: 0.0,
            square: 0.0,
            most: f64::INFINITY,
            margin: 0.0,
        }
    }

    /// Resets the estimate to this difference of measured and expected current.
    pub fn reset(&mut self, error: f64) {
        self.before = [error; 2];
        (self.sum, self.block_s, self.count) = (0.0, 0.0, 0);
        (self.elapsed_s, self.square, self.margin) = (0.0, 0.0, 0.0);
        self.most = f64::INFINITY;
    }

    /// Processes the next difference of measured and expected current, `dt_s` after the previous one, and returns the
    /// margin for noise in the residue \[effort unit\].
    #[inline]
    pub fn update(&mut self, dt_s: f64, error: f64) -> f64 {
        if dt_s <= 0.0 {
            return self.margin;
        }
        let [newest, oldest] = self.before;
        self.before = [error, newest];
        let difference = error - 2.0 * newest + oldest;
        self.sum += (difference * difference).min(self.most);
        self.block_s += dt_s;
        self.count += 1;
        if self.count == BLOCK {
            self.take_block();
        }
        self.margin
    }

    fn take_block(&mut self) {
        let count = f64::from(BLOCK);
        self.elapsed_s += self.block_s;
        let share = (self.block_s / self.elapsed_s.min(MEMORY_S)).min(1.0);
        self.square += share * (self.sum / count - self.square);
        self.most = CLIP * CLIP * self.square;
        // Share of the white noise's band, up to half the sample rate, that the low-pass transmits.
        let passes = (2.0 * self.bandwidth_hz * self.block_s / count).min(1.0);
        self.margin = SIGMAS * (self.square / SECOND_DIFFERENCE * passes).sqrt();
        (self.sum, self.block_s, self.count) = (0.0, 0.0, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CUTOFF_HZ: f64 = 15.0;

    /// Uniform noise of standard deviation 1.
    fn noise() -> impl FnMut() -> f64 {
        let mut state = 5_u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let even = (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5;
            even * 12.0_f64.sqrt()
        }
    }

    #[test]
    fn it_is_what_the_lowpass_leaves_of_white_noise() {
        let (mut estimate, mut lowpass) = (
            MeasurementNoise::new(CUTOFF_HZ),
            Butterworth2::new(CUTOFF_HZ),
        );
        let (mut noise, mut margin) = (noise(), 0.0);
        let (mut squares, count) = (0.0, 100_000);
        for k in 0..count {
            let x = noise();
            // A ramp, and a jump as in a collision, are not noise.
            let jump = if k > 50_000 { 20.0 } else { 0.0 };
            margin = estimate.update(0.002, x + 0.01 * f64::from(k) + jump);
            squares += lowpass.update(0.002, x).powi(2);
        }
        let sigma = (squares / f64::from(count)).sqrt();
        assert!(
            (margin / (SIGMAS * sigma) - 1.0).abs() < 0.05,
            "{margin} {sigma}"
        );
    }

    #[test]
    fn without_noise_there_is_none_and_repeated_stamps_change_nothing() {
        let mut estimate = MeasurementNoise::new(CUTOFF_HZ);
        estimate.reset(3.0);
        for _ in 0..100 {
            assert!(estimate.update(0.002, 3.0) < 1e-12);
        }
        let margin = estimate.update(0.0, 50.0);
        assert!((estimate.update(0.002, 3.0) - margin).abs() < 1e-12);
    }
}
