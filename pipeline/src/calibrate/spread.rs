//! Mean and standard deviation.

use tauscope_twin::ScoreStatistics;

/// Running mean and variance (Welford).
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Spread {
    /// Number of values.
    pub count: u64,
    mean: f64,
    squares: f64,
}

impl Spread {
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let delta = value - self.mean;
        self.mean += delta / self.count as f64;
        self.squares += delta * (value - self.mean);
    }

    fn variance(&self) -> f64 {
        self.squares / self.count.max(1) as f64
    }

    pub fn root_mean_square(&self) -> f64 {
        (self.variance() + self.mean * self.mean).sqrt()
    }

    pub fn statistics(&self) -> ScoreStatistics {
        ScoreStatistics {
            mean: self.mean,
            standard_deviation: self.variance().sqrt(),
            samples: self.count,
        }
    }
}
