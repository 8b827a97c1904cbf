//! A causal low-pass for uneven sample times.

use std::f64::consts::{PI, SQRT_2};

/// Share of a step that is still missing when the filter counts as settled.
/// From: the 1 % criterion of settling time (Franklin, Powell and Emami-Naeini, *Feedback Control of Dynamic
/// Systems*).
const SETTLED: f64 = 0.01;

/// A second-order Butterworth low-pass, `H(s) = ωc² / (s² + √2 ωc s + ωc²)` (S. Butterworth, "On the
/// Theory of Filter Amplifiers", 1930): amplitude 1/√2 at the cutoff, poles at `ωc/√2 (-1 ± i)`.
///
/// The continuous filter is solved exactly over each step for an input that is linear between samples (first-order
/// hold). So it needs no fixed rate, is stable at any rate, and remains the same filter if stamps jitter. A step of
/// zero or less (a repeated stamp) changes nothing.
#[derive(Debug, Clone)]
pub struct Butterworth2 {
    cutoff_rad_s: f64,
    /// Delay of the output on a ramp: √2 / ωc.
    lag_s: f64,
    state: Option<State>,
    step: Step,
}

#[derive(Debug, Clone, Copy)]
struct State {
    input: f64,
    output: f64,
    /// Derivative of the output, per second.
    rate: f64,
}

/// Decay of a deviation from the steady state over a step of `dt_s`; cached, because clocks are often even.
#[derive(Debug, Clone, Copy)]
struct Step {
    dt_s: f64,
    /// e^(-a dt) cos(a dt), e^(-a dt) sin(a dt) with a = ωc/√2, and the latter over a.
    cos: f64,
    sin: f64,
    sin_over_a_s: f64,
}

impl Butterworth2 {
    /// Noise bandwidth: white noise passes as through an ideal low-pass with this multiple of the cutoff, π / (2 √2).
    /// Statistical: the integral of |H|² over all frequencies, divided by the cutoff.
    pub const NOISE_BANDWIDTH: f64 = PI / (2.0 * SQRT_2);

    /// Creates a filter with its -3 dB point at `cutoff_hz`. Until [`Butterworth2::reset`] its first sample sets its
    /// state.
    ///
    /// # Panics
    /// If the cutoff is not positive and finite.
    pub fn new(cutoff_hz: f64) -> Self {
        assert!(
            cutoff_hz > 0.0 && cutoff_hz.is_finite(),
            "a cutoff of {cutoff_hz} Hz is not positive and finite"
        );
        Self {
            cutoff_rad_s: 2.0 * PI * cutoff_hz,
            lag_s: SQRT_2 / (2.0 * PI * cutoff_hz),
            state: None,
            step: Step {
                dt_s: 0.0,
                cos: 1.0,
                sin: 0.0,
                sin_over_a_s: 0.0,
            },
        }
    }

    /// Restarts the filter, settled at `x`.
    pub fn reset(&mut self, x: f64) {
        self.state = Some(State {
            input: x,
            output: x,
            rate: 0.0,
        });
    }

    /// Takes the input `x`, `dt_s` seconds after the previous one, and returns the output. If `dt_s` is not positive,
    /// `x` is ignored and the last output is returned.
    ///
    /// A `NaN` stays in the filter until [`Butterworth2::reset`].
    #[inline]
    pub fn update(&mut self, dt_s: f64, x: f64) -> f64 {
        self.advance(dt_s, x).output
    }

    /// The derivative of the output after the last update \[per second\]; 0 before the first.
    pub fn rate(&self) -> f64 {
        self.state.map_or(0.0, |state| state.rate)
    }

    /// Settling time: time after a step from which the output stays within 1 % of it \[s\], ln(√2 / 0.01) √2 / ωc,
    /// bounded by the decaying envelope.
    pub fn settling_time_s(&self) -> f64 {
        (SQRT_2 / SETTLED).ln() * SQRT_2 / self.cutoff_rad_s
    }

    #[inline]
    fn advance(&mut self, dt_s: f64, x: f64) -> State {
        let Some(before) = self.state else {
            self.reset(x);
            return State {
                input: x,
                output: x,
                rate: 0.0,
            };
        };
        if !(dt_s > 0.0 && dt_s.is_finite()) {
            return before;
        }
        let a = self.cutoff_rad_s / SQRT_2;
        if dt_s.to_bits() != self.step.dt_s.to_bits() {
            let (sin, cos) = (a * dt_s).sin_cos();
            let decay = (-a * dt_s).exp();
            self.step = Step {
                dt_s,
                cos: decay * cos,
                sin: decay * sin,
                sin_over_a_s: decay * sin / a,
            };
        }
        // On a ramp the output follows at a constant distance; a deviation from it decays freely.
        let slope = (x - before.input) / dt_s;
        let lag = slope * self.lag_s;
        let deviation = before.output - (before.input - lag);
        let drift = before.rate - slope;
        let Step {
            cos,
            sin,
            sin_over_a_s,
            ..
        } = self.step;
        let state = State {
            input: x,
            output: x - lag + (cos + sin) * deviation + sin_over_a_s * drift,
            rate: slope + (cos - sin) * drift - 2.0 * a * sin * deviation,
        };
        self.state = Some(state);
        state
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Response of the continuous filter to a unit step at 0.
    fn step_response(cutoff_hz: f64, t: f64) -> f64 {
        let at = 2.0 * PI * cutoff_hz / SQRT_2 * t;
        1.0 - (-at).exp() * (at.cos() + at.sin())
    }

    /// A step as input of a first-order hold: the input rises within a nanosecond.
    fn stepped(cutoff_hz: f64) -> Butterworth2 {
        let mut filter = Butterworth2::new(cutoff_hz);
        filter.reset(0.0);
        filter.update(1e-9, 1.0);
        filter
    }

    proptest! {
        #[test]
        fn follows_the_analytic_step_response_on_any_clock(
            cutoff_hz in 0.5..50.0_f64,
            steps in prop::collection::vec(1e-5..0.05_f64, 1..200),
        ) {
            let mut filter = stepped(cutoff_hz);
            let mut t = 0.0;
            for dt in steps {
                t += dt;
                let y = filter.update(dt, 1.0);
                prop_assert!((y - step_response(cutoff_hz, t)).abs() < 1e-6);
            }
        }

        #[test]
        fn splitting_a_straight_step_changes_nothing(
            dt in 1e-4..0.1_f64, part in 0.01..0.99_f64, x0 in -5.0..5.0_f64, x1 in -5.0..5.0_f64,
        ) {
            let mut whole = Butterworth2::new(4.0);
            whole.reset(1.0);
            whole.update(0.01, x0);
            let mut split = whole.clone();
            let y = whole.update(dt, x1);
            split.update(part * dt, x0 + part * (x1 - x0));
            prop_assert!((split.update((1.0 - part) * dt, x1) - y).abs() < 1e-9);
            prop_assert!((split.rate() - whole.rate()).abs() < 1e-6);
        }
    }

    /// Amplitude and phase lag \[rad\] for a sine of `hz` sampled at 1 kHz, by correlation over whole periods.
    fn response(cutoff_hz: f64, hz: f64) -> (f64, f64) {
        let (mut filter, dt) = (Butterworth2::new(cutoff_hz), 1e-3);
        filter.reset(0.0);
        let (mut in_phase, mut quadrature) = (0.0, 0.0);
        for k in 1..=8000 {
            let phase = 2.0 * PI * hz * f64::from(k) * dt;
            let y = filter.update(dt, phase.sin());
            if k > 4000 {
                in_phase += y * phase.sin() / 2000.0;
                quadrature += y * phase.cos() / 2000.0;
            }
        }
        (in_phase.hypot(quadrature), -quadrature.atan2(in_phase))
    }

    #[test]
    fn the_amplitude_is_3_db_down_at_the_cutoff_and_falls_by_40_db_a_decade() {
        let (gain, lag) = response(4.0, 4.0);
        assert!((gain - 1.0 / SQRT_2).abs() < 1e-4, "{gain}");
        assert!((lag - PI / 2.0).abs() < 1e-3, "{lag}");
        let (gain, _) = response(4.0, 0.25);
        assert!((gain - 1.0).abs() < 1e-4, "{gain}");
        let (gain, _) = response(4.0, 40.0);
        assert!((gain - 0.01).abs() < 1e-4, "{gain}");
    }

    #[test]
    fn a_ramp_is_followed_at_its_slope_and_a_fixed_lag() {
        let mut filter = Butterworth2::new(2.0);
        filter.reset(0.0);
        let mut y = 0.0;
        for k in 1..=1000 {
            y = filter.update(0.004, 0.3 * 0.004 * f64::from(k));
        }
        assert!((filter.rate() - 0.3).abs() < 1e-12);
        assert!((y - 0.3 * (4.0 - SQRT_2 / (4.0 * PI))).abs() < 1e-12);
    }

    #[test]
    fn is_settled_when_it_says_and_not_much_before() {
        let filter = stepped(3.0);
        let settled = filter.settling_time_s();
        for k in 0..100 {
            let y = filter
                .clone()
                .update(settled * (1.0 + 0.02 * f64::from(k)), 1.0);
            assert!((y - 1.0).abs() <= SETTLED);
        }
        assert!((stepped(3.0).update(0.7 * settled, 1.0) - 1.0).abs() > SETTLED);
    }

    #[test]
    fn a_repeated_or_backward_stamp_returns_the_last_output() {
        let mut filter = stepped(4.0);
        let y = filter.update(0.02, 1.0);
        for dt in [0.0, -0.01, f64::NAN] {
            assert_eq!(filter.update(dt, 7.0), y);
        }
        assert_eq!(Butterworth2::new(4.0).update(0.01, 7.0), 7.0);
    }

    #[test]
    #[should_panic(expected = "a cutoff of 0 Hz")]
    fn a_cutoff_of_zero_is_refused() {
        let _ = Butterworth2::new(0.0);
    }
}
