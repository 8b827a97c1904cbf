//! Zero-phase smoothing on any clock.
//!
//! Two operators, both linear, both without phase shift, both with the response
//! `H(f) = 1 / (1 + (f / fc)^6)` on an even clock: the quintic smoothing spline for motion, which also
//! gives derivatives, and its discrete form for everything that is compared, efforts and regressor
//! columns alike (Eilers, "A perfect smoother", *Analytical Chemistry*, 2003).

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Vector3};

use crate::read::recording::mean_step_s;

/// Weight of an excluded sample; the others have 1. It is not 0, so that a long gap stays determined.
/// Resolution: far below 1, so that nothing leaks, and far above the rounding of f64.
const PASSED_OVER: f64 = 1e-6;
/// Prior variance of the first state, relative to that of the measurement noise.
/// Resolution: the prior then weighs 1e-4 of one sample.
const DIFFUSE: f64 = 1e4;

/// A low-pass with the response `1 / (1 + (f / fc)^6)`, prepared for one clock: solves `(W + λ Dᵀ D) y = W x` with D
/// the third divided difference and W a weight per sample, 1 or almost 0. It has no phase shift and no transients at
/// the ends. Samples without weight are bridged and do not affect the others.
#[derive(Debug, Clone)]
pub struct LowPass {
    weight: Vec<f64>,
    /// The factors of the banded matrix L D Lᵀ: the diagonal, and L's three bands below it.
    diagonal: Vec<f64>,
    bands: Vec<[f64; 3]>,
}

impl LowPass {
    /// Creates the filter with half amplitude at `cutoff_hz` for samples at `time_s` \[s\], strictly increasing.
    pub fn new(time_s: &[f64], cutoff_hz: f64) -> Self {
        Self::weighted(time_s, cutoff_hz, |_| true)
    }

    /// Creates the filter without the samples that are not `used`.
    pub fn weighted(time_s: &[f64], cutoff_hz: f64, used: impl Fn(usize) -> bool) -> Self {
        let n = time_s.len();
        let weight: Vec<f64> = (0..n)
            .map(|k| if used(k) { 1.0 } else { PASSED_OVER })
            .collect();
        // Rows of A = W + λ Dᵀ D: the diagonal and three bands above it.
        let mut rows: Vec<[f64; 4]> = weight.iter().map(|w| [*w, 0.0, 0.0, 0.0]).collect();
        if n >= 4 {
            for i in 0..n - 3 {
                let t = &time_s[i..i + 4];
                let mean = (t[3] - t[0]) / 3.0;
                let lambda = (TAU * cutoff_hz * mean).powi(-6);
                // 3! times the divided difference, in units of the mean step.
                let mut d = [0.0; 4];
                for (a, weight) in d.iter_mut().enumerate() {
                    let others = (0..4).filter(|&b| b != a).map(|b| (t[a] - t[b]) / mean);
                    *weight = 6.0 / others.product::<f64>();
                }
                for a in 0..4 {
                    for b in a..4 {
                        rows[i + a][b - a] += lambda * d[a] * d[b];
                    }
                }
            }
        }
        let mut diagonal = vec![0.0; n];
        let mut bands = vec![[0.0; 3]; n];
        for i in 0..n {
            let mut pivot = rows[i][0];
            for k in 1..=3.min(i) {
                let l = bands[i][k - 1];
                pivot -= l * l * diagonal[i - k];
            }
            diagonal[i] = pivot;
            // L[i + m][i] for the rows below.
            for m in 1..=3 {
                if i + m >= n {
                    break;
                }
                let mut value = rows[i][m];
                for k in 1..=3 {
                    if k > i || m + k > 3 {
                        break;
                    }
                    value -= bands[i + m][m + k - 1] * bands[i][k - 1] * diagonal[i - k];
                }
                bands[i + m][m - 1] = value / pivot;
            }
        }
        Self {
            weight,
            diagonal,
            bands,
        }
    }

    /// Filters in place.
    ///
    /// # Panics
    /// If `x` is not one number per sample of the clock.
    pub fn apply(&self, x: &mut [f64]) {
        let n = self.diagonal.len();
        assert_eq!(x.len(), n, "one number per sample");
        // The newest of the three previous values is added last: only that operation waits for the previous step.
        let mut before = [0.0; 3];
        for ((x, l), weight) in x.iter_mut().zip(&self.bands).zip(&self.weight) {
            let rest = weight * *x - l[2] * before[2] - l[1] * before[1];
            *x = rest - l[0] * before[0];
            before = [*x, before[0], before[1]];
        }
        for (value, pivot) in x.iter_mut().zip(&self.diagonal) {
            *value /= pivot;
        }
        // The contributions of the three values after, each multiplied by its band.
        let mut owed = [0.0; 3];
        for (x, l) in x.iter_mut().zip(&self.bands).rev() {
            *x -= owed[0];
            owed = [owed[1] + l[0] * *x, owed[2] + l[1] * *x, l[2] * *x];
        }
    }
}

/// Position, velocity and acceleration of a joint from its positions: the quintic smoothing spline, found
/// as the Rauch-Tung-Striebel smoother of a point whose jerk is white noise (Särkkä, *Bayesian Filtering
/// and Smoothing*, 2013, sections 4.3 and 8.2). The gains depend on the clock alone and serve all joints.
#[derive(Debug)]
pub struct MotionSmoother {
    steps_s: Vec<f64>,
    /// Kalman gain per sample.
    gains: Vec<Vector3<f64>>,
    /// Smoother gain from each sample to the next.
    backward: Vec<Matrix3<f64>>,
}

impl MotionSmoother {
    /// Creates the smoother with half amplitude at `cutoff_hz` for samples at `time_s` \[s\], strictly increasing.
    pub fn new(time_s: &[f64], cutoff_hz: f64) -> Self {
        let n = time_s.len();
        let omega = TAU * cutoff_hz;
        let mut steps_s = vec![0.0; n];
        for (i, pair) in time_s.windows(2).enumerate() {
            steps_s[i + 1] = pair[1] - pair[0];
        }
        let mean = mean_step_s(time_s);
        // With measurement noise of variance 1 every `mean` seconds, a jerk of this spectral density puts
        // the half-amplitude point at the cutoff.
        let density = omega.powi(6) * mean;
        let mut covariance = Matrix3::from_diagonal(&Vector3::new(
            DIFFUSE,
            DIFFUSE * omega * omega,
            DIFFUSE * omega.powi(4),
        ));
        let (mut gains, mut backward) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for (i, &step_s) in steps_s.iter().enumerate() {
            if i > 0 {
                let f = transition(step_s);
                let predicted = f * covariance * f.transpose() + diffusion(step_s, density);
                let inverse = predicted.try_inverse().unwrap_or_else(Matrix3::zeros);
                backward.push(covariance * f.transpose() * inverse);
                covariance = predicted;
            }
            let gain: Vector3<f64> = covariance.column(0) / (covariance.m11 + 1.0);
            // Joseph's form keeps it symmetric and positive.
            let mut keep = Matrix3::identity();
            keep.set_column(0, &(keep.column(0) - gain));
            covariance = keep * covariance * keep.transpose() + gain * gain.transpose();
            gains.push(gain);
        }
        Self {
            steps_s,
            gains,
            backward,
        }
    }

    /// Returns position, velocity and acceleration at each sample from measured positions.
    ///
    /// # Panics
    /// If `position` is not one number per sample of the clock.
    pub fn smooth(&self, position: &[f64]) -> Vec<Vector3<f64>> {
        assert_eq!(position.len(), self.gains.len(), "one position per sample");
        let mut states: Vec<Vector3<f64>> = Vec::with_capacity(position.len());
        // Relative to the first position, so that the wide prior does not pull towards zero.
        let origin = position.first().copied().unwrap_or(0.0);
        let mut state = Vector3::zeros();
        for (i, &measured) in position.iter().enumerate() {
            if i > 0 {
                state = transition(self.steps_s[i]) * state;
            }
            state += self.gains[i] * (measured - origin - state.x);
            states.push(state);
        }
        for i in (0..position.len().saturating_sub(1)).rev() {
            let predicted = transition(self.steps_s[i + 1]) * states[i];
            let next = states[i + 1];
            states[i] += self.backward[i] * (next - predicted);
        }
        for state in &mut states {
            state.x += origin;
        }
        states
    }
}

#[inline]
fn transition(dt: f64) -> Matrix3<f64> {
    Matrix3::new(1.0, dt, 0.5 * dt * dt, 0.0, 1.0, dt, 0.0, 0.0, 1.0)
}

fn diffusion(dt: f64, density: f64) -> Matrix3<f64> {
    let (a, b, c, d, e) = (
        dt.powi(5) / 20.0,
        dt.powi(4) / 8.0,
        dt.powi(3) / 6.0,
        dt.powi(3) / 3.0,
        dt.powi(2) / 2.0,
    );
    density * Matrix3::new(a, b, c, b, d, e, c, e, dt)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(n: usize, jitter: f64) -> Vec<f64> {
        let mut seed = 1_u64;
        (0..n)
            .map(|k| {
                seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                0.01 * (k as f64 + jitter * ((seed >> 33) as f64 / 2f64.powi(31) - 0.5))
            })
            .collect()
    }

    /// Returns the gain of the filter in the middle of a long sine.
    fn response(jitter: f64, hz: f64) -> f64 {
        let time = clock(4000, jitter);
        let mut x: Vec<f64> = time.iter().map(|t| (TAU * hz * t).sin()).collect();
        LowPass::new(&time, 8.0).apply(&mut x);
        let (mut xy, mut yy) = (0.0, 0.0);
        for k in 500..3500 {
            let s = (TAU * hz * time[k]).sin();
            xy += s * x[k];
            yy += s * s;
        }
        xy / yy
    }

    #[test]
    fn half_amplitude_at_the_cutoff_and_flat_below() {
        assert!((response(0.0, 8.0) - 0.5).abs() < 0.03);
        assert!((response(0.0, 2.0) - 1.0).abs() < 1e-3);
        assert!(response(0.0, 24.0) < 0.01);
        assert!((response(0.3, 2.0) - 1.0).abs() < 5e-3);
    }

    #[test]
    fn a_parabola_passes_unchanged_to_the_ends() {
        let time = clock(300, 0.4);
        let parabola: Vec<f64> = time.iter().map(|t| 1.0 + 2.0 * t - 0.7 * t * t).collect();
        let mut x = parabola.clone();
        LowPass::new(&time, 5.0).apply(&mut x);
        for (a, b) in x.iter().zip(&parabola) {
            assert!((a - b).abs() < 1e-6);
        }
    }

    #[test]
    fn derivatives_of_a_sine_are_right_on_an_uneven_clock() {
        let time = clock(1000, 0.5);
        let omega = TAU * 1.5;
        let position: Vec<f64> = time.iter().map(|t| 3.0 + (omega * t).sin()).collect();
        let states = MotionSmoother::new(&time, 16.0).smooth(&position);
        for (t, state) in time.iter().zip(&states).skip(30).take(940) {
            assert!((state.y - omega * (omega * t).cos()).abs() < 2e-3 * omega);
            assert!((state.z + omega * omega * (omega * t).sin()).abs() < 5e-3 * omega * omega);
        }
    }
}
