//! A causal derivative for uneven sample times.

use crate::lowpass::Butterworth2;

/// The derivative of a signal below a cutoff: the signal through a [`Butterworth2`], whose output's
/// slope is the estimate.
///
/// The slope is a state of the filter and so exact for it: no difference of nearly equal numbers is
/// divided by a jittering step, and no half sample of delay is added. A constant slope is met exactly
/// once the filter has settled.
///
/// A repeated stamp does not change the estimate. A row that repeats the previous value under a new stamp is treated
/// as standstill, so a source must drop repeated rows.
#[derive(Debug, Clone)]
pub struct FilteredDerivative {
    filter: Butterworth2,
}

impl FilteredDerivative {
    /// Creates a derivative with a bandwidth of about `cutoff_hz`. Until [`FilteredDerivative::reset`] its first
    /// sample sets its state.
    ///
    /// # Panics
    /// If the cutoff is not positive and finite.
    pub fn new(cutoff_hz: f64) -> Self {
        Self {
            filter: Butterworth2::new(cutoff_hz),
        }
    }

    /// Restarts the filter at `x`, at rest.
    pub fn reset(&mut self, x: f64) {
        self.filter.reset(x);
    }

    /// Takes `x`, `dt_s` seconds after the previous value, and returns the derivative \[unit of x per second\]. If
    /// `dt_s` is not positive, returns the last derivative.
    pub fn update(&mut self, dt_s: f64, x: f64) -> f64 {
        self.filter.update(dt_s, x);
        self.filter.rate()
    }

    /// Time after a change of slope until the estimate is within 1 % of the change \[s\].
    pub fn settling_time_s(&self) -> f64 {
        self.filter.settling_time_s()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_slope_is_met_on_an_uneven_clock_with_repeated_stamps() {
        let mut derivative = FilteredDerivative::new(10.0);
        derivative.reset(1.0);
        let (mut t, mut last) = (0.0, 0.0);
        for k in 0..400 {
            let dt = [0.001, 0.0, 0.012, 0.003][k % 4];
            t += dt;
            let slope = derivative.update(dt, 1.0 + 2.5 * t);
            if dt == 0.0 {
                assert_eq!(slope, last);
            }
            if t > derivative.settling_time_s() {
                assert!((slope - 2.5).abs() < 0.025);
            }
            last = slope;
        }
        assert!((last - 2.5).abs() < 1e-12);
    }

    #[test]
    fn a_slow_sine_gives_its_cosine() {
        let mut derivative = FilteredDerivative::new(20.0);
        let lag = std::f64::consts::SQRT_2 / (2.0 * PI * 20.0);
        derivative.reset(0.0);
        for k in 1..=3000 {
            let t = 1e-3 * f64::from(k);
            let slope = derivative.update(1e-3, (2.0 * t).sin());
            if t > 0.2 {
                assert!((slope - 2.0 * (2.0 * (t - lag)).cos()).abs() < 1e-3);
            }
        }
    }

    #[test]
    fn starts_at_rest() {
        assert_eq!(FilteredDerivative::new(5.0).update(0.01, 3.0), 0.0);
    }
}
