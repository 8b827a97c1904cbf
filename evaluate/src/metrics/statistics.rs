//! Mean, spread and percentiles.

use serde::Serialize;

/// A distribution in a few numbers; NaN where there is nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distribution {
    /// How many.
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
    /// Of these values.
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

/// Mean and standard deviation over n; NaN of nothing.
pub fn mean_sd(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / n).sqrt())
}

/// The value below which this share of `sorted` lies, between two neighbours by a straight line; NaN of
/// nothing.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let at = share * last as f64;
    let (below, above) = (at.floor() as usize, at.ceil() as usize);
    sorted[below] + (at - at.floor()) * (sorted[above] - sorted[below])
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
}
