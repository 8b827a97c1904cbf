//! Noise of a joint's effort: white noise and slow noise, and the filter that makes both white.
//!
//! The slow part is an Ornstein-Uhlenbeck process, which is exact on uneven clocks and across rows that are left out. A
//! Kalman filter computes the innovations of the sum (Durbin and Koopman, *Time Series Analysis by State Space Methods*,
//! 2012, chapter 4). It is linear, so measurement and columns pass through the same filter.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::rows::Rows;

/// The noise of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of the white part \[N m or N\].
    pub white: f64,
    /// Stationary standard deviation of the slow part \[N m or N\].
    pub slow: f64,
    /// Correlation time of the slow part \[s\].
    pub time_s: f64,
}

/// Shortest correlation time \[s\]. Derived: about one period of the filter of the comparison, below which slow noise
/// cannot be distinguished from filtered white noise.
const LEAST_TIME_S: f64 = 0.15;
/// Smallest standard deviation of the noise, as a share of the joint's effort. Chosen: so that no
/// joint weighs without bound.
const LEAST_SHARE: f64 = 5e-4;
/// Slow noise above this share of the joint's effort is unlikely beforehand. Chosen: with [`SLOW_SPREAD`], so that an
/// effect that grows over minutes is an effect and not noise.
const USUAL_SLOW_SHARE: f64 = 0.01;
/// Standard deviation of the logarithm of the slow noise above that share \[nats\]. Chosen: as above.
const SLOW_SPREAD: f64 = 0.8;
/// Standard deviation of the logarithm of the correlation time beyond [`LEAST_TIME_S`] \[nats\]. Chosen: 0.02 to 50 s.
const TIME_SPREAD: f64 = 2.0;

impl Noise {
    /// The noise that an estimate starts from, for a joint whose effort has this root mean square.
    pub fn start(effort_rms: f64) -> Self {
        Self {
            white: 0.02 * effort_rms,
            slow: 0.5 * USUAL_SLOW_SHARE * effort_rms,
            time_s: LEAST_TIME_S + 1.0,
        }
    }

    fn from_logs([white, slow, time]: [f64; 3], effort_rms: f64, least_white: f64) -> Self {
        Self {
            white: white.exp().max(LEAST_SHARE * effort_rms).max(least_white),
            slow: slow.exp().max(0.1 * LEAST_SHARE * effort_rms),
            time_s: LEAST_TIME_S + time.exp(),
        }
    }

    fn logs(&self) -> [f64; 3] {
        [
            self.white.ln(),
            self.slow.ln(),
            (self.time_s - LEAST_TIME_S).max(1e-6).ln(),
        ]
    }

    /// Logarithm of the prior density, up to a constant \[nats\].
    pub fn log_prior(&self, effort_rms: f64) -> f64 {
        let [_, slow, time] = self.logs();
        let above = (slow - (USUAL_SLOW_SHARE * effort_rms).ln()).max(0.0);
        -0.5 * (time / TIME_SPREAD).powi(2) - 0.5 * (above / SLOW_SPREAD).powi(2)
    }
}

/// The whitening filter of a joint: the Kalman gains depend on the clock and the noise alone.
#[derive(Debug, Clone)]
pub struct Whitener {
    decay: Vec<f64>,
    gain: Vec<f64>,
    inverse: Vec<f64>,
    /// Half the logarithm of the determinant of the noise covariance.
    pub half_log_det: f64,
}

impl Whitener {
    /// The filter for a joint's rows; `extra` is additional variance of each row.
    pub fn new(rows: &Rows, noise: &Noise, extra: &[f64]) -> Self {
        let count = rows.len();
        let mut filter = Self {
            decay: Vec::with_capacity(count),
            gain: Vec::with_capacity(count),
            inverse: Vec::with_capacity(count),
            half_log_det: 0.0,
        };
        let stationary = noise.slow * noise.slow;
        let mut variance = stationary;
        for (k, extra) in extra.iter().enumerate() {
            let decay = if k == 0 || rows.recording[k] != rows.recording[k - 1] {
                variance = stationary;
                0.0
            } else {
                let decay = (-(rows.time_s[k] - rows.time_s[k - 1]) / noise.time_s).exp();
                variance = decay * decay * variance + stationary * (1.0 - decay * decay);
                decay
            };
            let innovation = variance + noise.white * noise.white + extra;
            let gain = variance / innovation;
            filter.decay.push(decay);
            filter.gain.push(gain);
            filter.inverse.push(1.0 / innovation.sqrt());
            filter.half_log_det += 0.5 * innovation.ln();
            variance *= 1.0 - gain;
        }
        filter
    }

    /// The filter of a likelihood that is raised to the power `weight`.
    #[must_use]
    pub fn tempered(mut self, weight: f64) -> Self {
        self.half_log_det *= weight;
        for inverse in &mut self.inverse {
            *inverse *= weight.sqrt();
        }
        self
    }

    /// Whitens one column of picked rows in place.
    pub fn apply(&self, column: &mut [f64]) {
        let mut mean = 0.0;
        let steps = self.decay.iter().zip(&self.gain).zip(&self.inverse);
        for (x, ((decay, gain), inverse)) in column.iter_mut().zip(steps) {
            mean *= decay;
            let innovation = *x - mean;
            mean += gain * innovation;
            *x = innovation * inverse;
        }
    }
}

/// Steps of the pattern search in the logarithms of white noise, slow noise and correlation time. Resolution: changes
/// the number of evaluations.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.08;

/// The data that a joint's noise is estimated from.
pub struct Data<'a> {
    /// Its rows.
    pub rows: &'a Rows,
    /// Measured effort of each row.
    pub y: &'a [f64],
    /// Columns that may explain it, each at one prior standard deviation.
    pub columns: &'a DMatrix<f64>,
    /// Additional variance of each row.
    pub extra: &'a [f64],
}

/// Estimates the noise of a joint by marginal likelihood, with the coefficients of the columns integrated out under
/// standard normal priors (restricted maximum likelihood with informative priors; Searle, Casella and `McCulloch`,
/// *Variance Components*, 1992, chapter 6). White noise is at least `least_white`, slow noise at most `most_slow`.
pub fn estimate(
    data: &Data<'_>,
    effort_rms: f64,
    start: Noise,
    (least_white, most_slow): (f64, f64),
) -> Noise {
    let Data {
        rows,
        y,
        columns,
        extra,
    } = *data;
    let columns = compressed(columns, effort_rms);
    let cost = |logs: [f64; 3]| {
        let noise = Noise::from_logs(logs, effort_rms, least_white);
        if noise.slow > most_slow {
            return f64::INFINITY;
        }
        if noise.time_s > 60.0 || noise.white.max(noise.slow) > 3.0 * effort_rms {
            return f64::INFINITY;
        }
        let filter = Whitener::new(rows, &noise, extra);
        filter.half_log_det + quadratic(&filter, y, &columns) - noise.log_prior(effort_rms)
    };
    let start = Noise {
        slow: start.slow.min(0.5 * most_slow),
        ..start
    };
    let mut best = start.logs();
    let mut least = cost(best);
    let mut step = FIRST_STEP;
    while step > LAST_STEP {
        let mut improved = false;
        for axis in 0..3 {
            for sign in [1.0, -1.0] {
                let mut there = best;
                there[axis] += sign * step;
                let value = cost(there);
                if value < least - 1e-3 {
                    (best, least, improved) = (there, value, true);
                    break;
                }
            }
        }
        if !improved {
            step *= 0.5;
        }
    }
    Noise::from_logs(best, effort_rms, least_white)
}

/// Half the squared residual, and half the logarithm of the determinant, with the columns' coefficients integrated out.
fn quadratic(filter: &Whitener, y: &[f64], columns: &DMatrix<f64>) -> f64 {
    let mut white_y = y.to_vec();
    filter.apply(&mut white_y);
    let mut white = columns.clone();
    for mut column in white.column_iter_mut() {
        filter.apply(column.as_mut_slice());
    }
    let y = DVector::from_vec(white_y);
    // The product of matrices is blocked, that of a transpose is not.
    let mut normal = white.transpose() * &white;
    for i in 0..normal.nrows() {
        normal[(i, i)] += 1.0;
    }
    let right = white.tr_mul(&y);
    let Some(factor) = normal.cholesky() else {
        return f64::INFINITY;
    };
    let lower = factor.l_dirty();
    let mut solved = right;
    lower.solve_lower_triangular_mut(&mut solved);
    let log_det: f64 = lower.diagonal().iter().map(|d| d.ln()).sum();
    0.5 * (y.norm_squared() - solved.norm_squared()) + log_det
}

/// The principal components of columns whose prior effort is above the resolution.
fn compressed(columns: &DMatrix<f64>, effort_rms: f64) -> DMatrix<f64> {
    if columns.ncols() == 0 {
        return columns.clone();
    }
    let eigen = SymmetricEigen::new(columns.transpose() * columns);
    let least = (1e-3 * effort_rms).powi(2) * columns.nrows() as f64;
    let kept: Vec<usize> = (0..columns.ncols())
        .filter(|&i| eigen.eigenvalues[i] > least)
        .collect();
    columns * eigen.eigenvectors.select_columns(&kept)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::Noise as Random;

    fn rows(count: usize) -> Rows {
        Rows {
            row: (0..count).collect(),
            recording: (0..count).map(|k| k * 2 / count).collect(),
            piece: (0..count).map(|k| k * 2 / count).collect(),
            time_s: (0..count)
                .map(|k| 0.06 * (k % (count / 2)) as f64)
                .collect(),
        }
    }

    /// Slow noise of 0.3 with a correlation time of 1 s, and white noise of 0.1.
    fn sample(rows: &Rows, seed: u64) -> Vec<f64> {
        let mut random = Random(seed);
        let mut slow = 0.3 * random.next();
        let step = |k: usize| {
            let decay = if k.is_multiple_of(rows.len() / 2) {
                0.0
            } else {
                (-0.06_f64).exp()
            };
            slow = decay * slow + 0.3 * (1.0 - decay * decay).sqrt() * random.next();
            slow + 0.1 * random.next()
        };
        (0..rows.len()).map(step).collect()
    }

    #[test]
    fn the_innovations_of_such_noise_are_white_with_variance_one() {
        let rows = rows(4000);
        let noise = Noise {
            white: 0.1,
            slow: 0.3,
            time_s: 1.0,
        };
        let mut y = sample(&rows, 3);
        Whitener::new(&rows, &noise, &vec![0.0; rows.len()]).apply(&mut y);
        let variance = y.iter().map(|x| x * x).sum::<f64>() / y.len() as f64;
        let lag_one = y.windows(2).map(|x| x[0] * x[1]).sum::<f64>() / y.len() as f64;
        assert!((variance - 1.0).abs() < 0.1, "{variance}");
        assert!(lag_one.abs() < 0.06, "{lag_one}");
    }

    #[test]
    fn both_parts_of_the_noise_are_estimated_beside_a_column() {
        let rows = rows(4000);
        let column: Vec<f64> = rows.time_s.iter().map(|t| (0.7 * t).sin()).collect();
        let noise = sample(&rows, 5);
        let y: Vec<f64> = noise
            .iter()
            .zip(&column)
            .map(|(e, x)| e + 2.0 * x)
            .collect();
        let columns = DMatrix::from_vec(rows.len(), 1, column.iter().map(|x| 5.0 * x).collect());
        let extra = vec![0.0; rows.len()];
        let data = Data {
            rows: &rows,
            y: &y,
            columns: &columns,
            extra: &extra,
        };
        let found = estimate(&data, 10.0, Noise::start(10.0), (0.0, f64::INFINITY));
        assert!((found.white / 0.1).ln().abs() < 0.2, "{found:?}");
        assert!((found.slow / 0.3).ln().abs() < 0.4, "{found:?}");
    }
}
