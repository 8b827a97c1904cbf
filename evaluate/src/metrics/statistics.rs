//! Mean, spread and percentiles.

use serde::Serialize;

/// Summary of a distribution; NaN without values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distribution {
    /// Number of values.
    pub count: usize,
    /// Mean.
    pub mean: f64,
    /// Standard deviation (over n, not n - 1).
    pub sd: f64,
    /// Median.
    pub p50: f64,
    /// 90th percentile.
    pub p90: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
}

impl Distribution {
    /// Summarises these values.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = values.into_iter().collect();
        sorted.sort_by(f64::total_cmp);
        let (mean, sd) = mean_sd(&sorted);
        Self {
            count: sorted.len(),
            mean,
            sd,
            p50: quantile(&sorted, 0.5),
            p90: quantile(&sorted, 0.9),
            p95: quantile(&sorted, 0.95),
            p99: quantile(&sorted, 0.99),
        }
    }
}

/// Mean and standard deviation over n; NaN without values.
pub fn mean_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / n).sqrt())
}

/// Quantile of `sorted`, linearly interpolated between neighbours; NaN without values.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    let (below, above) = (at.floor() as usize, at.ceil() as usize);
    sorted[below] + (at - at.floor()) * (sorted[above] - sorted[below])
}

/// One-sided 95 % upper bound on the mean of a Poisson distribution, given an observed count: the mean at which
/// `count` or fewer events have a probability of 0.05 (Garwood, "Fiducial limits for the Poisson distribution",
/// 1936).
pub fn poisson_bound_95(count: usize) -> f64 {
    /// Statistical: one of 20.
    const RARE: f64 = 0.05;
    /// Resolution: a float has 53 bits.
    const HALVINGS: usize = 60;
    // Cumulative probability of `count` or fewer events. The terms are computed as logarithms because e^-mean may
    // underflow.
    let so_few = |mean: f64| {
        let (mut log_term, mut sum) = (-mean, (-mean).exp());
        for k in 1..=count {
            log_term += (mean / k as f64).ln();
            sum += log_term.exp();
        }
        sum
    };
    let n = count as f64;
    let (mut low, mut high) = (n, n + 4.0 * n.sqrt() + 10.0);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(low, high);
        if so_few(middle) > RARE {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_lie_between_neighbours() {
        let of = Distribution::of([4.0, 1.0, 3.0, 2.0]);
        assert_eq!((of.mean, of.p50), (2.5, 2.5));
        assert!((of.sd - 1.25_f64.sqrt()).abs() < 1e-15);
        assert!((of.p90 - 3.7).abs() < 1e-12);
    }

    #[test]
    fn nothing_has_no_mean() {
        let of = Distribution::of([]);
        assert!(of.mean.is_nan() && of.p99.is_nan());
    }

    #[test]
    fn nothing_in_five_minutes_is_under_36_an_hour() {
        // Half of the 95 % quantile of chi squared with 2 k + 2 degrees of freedom.
        for (count, bound) in [(0, 2.9957), (1, 4.7439), (10, 16.9622), (100, 118.0793)] {
            assert!((poisson_bound_95(count) - bound).abs() < 1e-3, "{count}");
        }
        assert!((poisson_bound_95(0) / (5.0 / 60.0) - 35.95).abs() < 0.01);
        assert!(poisson_bound_95(2000).is_finite());
    }
}
