//! The trend of a current: its low-passed value with first and second derivative (section 3.2), and
//! the running bounds of the noise on the measured one's derivative (section 3.2.1).

use tauscope_dynamics::lowpass::Butterworth2;

/// Half width of the noise bounds, in standard deviations of the derivatives' error.
/// Statistical: Gaussian noise goes beyond three standard deviations once in 370 samples.
const BOUND_SIGMAS: f64 = 3.0;
/// Half width of the paper's "further much higher bound", in the same standard deviations.
/// Statistical: twice [`BOUND_SIGMAS`]. Gaussian noise goes beyond six standard deviations once in 500 million
/// samples, 12 days at 500 Hz.
const IMPULSE_SIGMAS: f64 = 2.0 * BOUND_SIGMAS;
/// Memory of the noise statistics \[s\].
/// Chosen: about 100 independent values behind the 15 Hz low-pass, a standard error of 7 %. With a shorter memory the
/// bounds fluctuate, with a longer one they follow a change of the noise late.
const NOISE_MEMORY_S: f64 = 2.0;
/// Time during which errors are not clipped, because there are no bounds yet \[s\].
/// Chosen: longer than the low-pass takes to settle (0.07 s), as its transient would set the bounds otherwise. It
/// ends before the sensor is ready (0.27 s), so that a collision cannot widen them.
const NOISE_SETTLING_S: f64 = 0.2;

/// A low-passed current and its derivatives.
#[derive(Debug, Clone)]
pub(super) struct Trend {
    lowpass: Butterworth2,
    cutoff_rad_s: f64,
    /// The low-passed value \[effort unit\].
    pub value: f64,
    /// Its first derivative, the paper's `dp_I` \[effort unit/s\].
    pub rate: f64,
    /// Its second derivative \[effort unit/s²\].
    pub curvature: f64,
}

impl Trend {
    pub fn new(cutoff_hz: f64) -> Self {
        Self {
            lowpass: Butterworth2::new(cutoff_hz),
            cutoff_rad_s: std::f64::consts::TAU * cutoff_hz,
            value: 0.0,
            rate: 0.0,
            curvature: 0.0,
        }
    }

    /// Resets the trend to the steady state at `x`.
    pub fn reset(&mut self, x: f64) {
        self.lowpass.reset(x);
        (self.value, self.rate, self.curvature) = (x, 0.0, 0.0);
    }

    /// Processes the current `x`, `dt_s` seconds after the previous one.
    pub fn update(&mut self, dt_s: f64, x: f64) {
        self.value = self.lowpass.update(dt_s, x);
        self.rate = self.lowpass.rate();
        // The filter's own differential equation: y'' = ωc² (x - y) - √2 ωc y'.
        let omega = self.cutoff_rad_s;
        self.curvature =
            omega * omega * (x - self.value) - std::f64::consts::SQRT_2 * omega * self.rate;
    }
}

/// Range of an error between the derivatives of measured and expected current.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Band {
    /// Within the noise bounds.
    Noise,
    /// Beyond the noise bounds.
    Beyond,
    /// Beyond the higher bounds.
    Impulse,
}

/// Running mean and spread of the error between the derivatives, `Th_min` and `Th_max` of figure 8.
#[derive(Debug, Clone, Default)]
pub(super) struct NoiseBounds {
    mean: f64,
    variance: f64,
    /// Square root of `variance`.
    sigma: f64,
    elapsed_s: f64,
}

impl NoiseBounds {
    /// Returns the standard deviation of the error \[effort unit/s\].
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Returns `Th_min` and `Th_max` \[effort unit/s\].
    pub fn bounds(&self) -> (f64, f64) {
        let half = BOUND_SIGMAS * self.sigma();
        (self.mean - half, self.mean + half)
    }

    /// Returns the range of `error`.
    pub fn band(&self, error: f64) -> Band {
        let off = (error - self.mean).abs();
        if off <= BOUND_SIGMAS * self.sigma() {
            Band::Noise
        } else if off <= IMPULSE_SIGMAS * self.sigma() {
            Band::Beyond
        } else {
            Band::Impulse
        }
    }

    /// Returns whether a derivative is outside `Th_min` and `Th_max`.
    pub fn is_over(&self, rate: f64) -> bool {
        let (low, high) = self.bounds();
        !(low..=high).contains(&rate)
    }

    /// Processes the next error, clipped to the bounds: a collision widens them only slightly, whereas increased
    /// noise widens them over time.
    pub fn update(&mut self, dt_s: f64, error: f64) {
        if dt_s <= 0.0 {
            return;
        }
        self.elapsed_s += dt_s;
        let share = (dt_s / self.elapsed_s.min(NOISE_MEMORY_S)).min(1.0);
        let mut off = error - self.mean;
        if self.elapsed_s > NOISE_SETTLING_S {
            let half = BOUND_SIGMAS * self.sigma();
            off = off.clamp(-half, half);
        }
        self.mean += share * off;
        self.variance += share * ((1.0 - share) * off * off - self.variance);
        self.sigma = self.variance.sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_slope_and_no_curvature_and_a_bend_has_one() {
        let mut trend = Trend::new(15.0);
        trend.reset(0.0);
        for k in 1..=500 {
            trend.update(0.002, 0.006 * f64::from(k));
        }
        assert!((trend.rate - 3.0).abs() < 1e-9);
        assert!(trend.curvature.abs() < 1e-6);
        // A parabola 5 t² has the second derivative 10.
        for k in 1..=500 {
            let t = 0.002 * f64::from(k);
            trend.update(0.002, 3.0 + 3.0 * t + 5.0 * t * t);
        }
        assert!((trend.curvature - 10.0).abs() < 0.1, "{}", trend.curvature);
    }

    /// Errors that alternate between +1 and -1 around `offset`, for 5 s at 500 Hz.
    fn noisy(offset: f64) -> NoiseBounds {
        let mut bounds = NoiseBounds::default();
        for k in 0..2500 {
            bounds.update(0.002, offset + if k % 2 == 0 { 1.0 } else { -1.0 });
        }
        bounds
    }

    #[test]
    fn the_bounds_lie_three_deviations_about_the_mean_and_the_higher_ones_six() {
        let bounds = noisy(0.5);
        let (low, high) = bounds.bounds();
        assert!(
            (low + 2.5).abs() < 0.02 && (high - 3.5).abs() < 0.02,
            "{low} {high}"
        );
        assert_eq!(bounds.band(3.4), Band::Noise);
        assert_eq!(bounds.band(3.6), Band::Beyond);
        assert_eq!(bounds.band(-2.6), Band::Beyond);
        assert_eq!(bounds.band(6.6), Band::Impulse);
        assert!(!bounds.is_over(3.4) && bounds.is_over(3.6) && bounds.is_over(-2.6));
    }

    #[test]
    fn a_collision_widens_the_bounds_little_and_lasting_noise_widens_them() {
        let mut bounds = noisy(0.0);
        for _ in 0..15 {
            bounds.update(0.002, 1000.0);
        }
        assert!(bounds.sigma() < 1.2, "{}", bounds.sigma());
        for k in 0..2500 {
            bounds.update(0.002, if k % 2 == 0 { 5.0 } else { -5.0 });
        }
        assert!((bounds.sigma() - 5.0).abs() < 0.5, "{}", bounds.sigma());
    }
}
