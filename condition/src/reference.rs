//! Prediction of the next night: the level of the nights before, and the effect of the joint's temperature.
//!
//! A recursive linear regression, one night at a time. Its recursive residuals are independent and have one variance
//! while nothing changes: R. L. Brown, J. Durbin and J. M. Evans, "Techniques for Testing the Constancy of Regression
//! Relationships over Time", JRSS B 37(2), 1975, section 2.2. The prediction for a temperature outside the learned
//! range has a large uncertainty, so that cold nights are not reported as wear.

use crate::series::Estimate;

/// Regression over the learned nights.
#[derive(Debug, Clone)]
pub struct Reference {
    /// Centre of the covariate, for numerical precision.
    centre: f64,
    /// Information matrix of level and slope.
    information: [[f64; 2]; 2],
    /// Right-hand side of the normal equations.
    right: [f64; 2],
    has_slope: bool,
    /// Sum of squares of the standardised recursive residuals.
    squares: f64,
    /// Number of these residuals.
    count: usize,
    learned: usize,
}

/// Prediction for one night.
#[derive(Debug, Clone, Copy)]
pub struct Expected {
    /// Predicted value.
    pub value: f64,
    /// Standard deviation of the night's value from it, from the intervals alone.
    pub deviation: f64,
}

impl Reference {
    /// A regression without nights. `slope_deviation` is the standard deviation of the slope's prior, 0 for no slope;
    /// `centre` is a covariate near those that follow.
    pub fn new(slope_deviation: f64, centre: f64) -> Self {
        let mut information = [[0.0; 2]; 2];
        let has_slope = slope_deviation > 0.0;
        if has_slope {
            information[1][1] = slope_deviation.powi(-2);
        }
        Self {
            centre,
            information,
            right: [0.0; 2],
            has_slope,
            squares: 0.0,
            count: 0,
            learned: 0,
        }
    }

    fn row(&self, covariate: f64) -> [f64; 2] {
        let slope = if self.has_slope {
            covariate - self.centre
        } else {
            0.0
        };
        [1.0, slope]
    }

    /// Inverse of the information; `None` before the first night.
    fn covariance(&self) -> Option<[[f64; 2]; 2]> {
        let [[a, b], [_, c]] = self.information;
        if !self.has_slope {
            return (a > 0.0).then(|| [[1.0 / a, 0.0], [0.0, 0.0]]);
        }
        let determinant = a * c - b * b;
        let sound = a > 0.0 && determinant > 1e-12 * a * c;
        sound.then(|| {
            [
                [c / determinant, -b / determinant],
                [-b / determinant, a / determinant],
            ]
        })
    }

    /// Level at the centre of the covariate, and slope.
    pub fn coefficients(&self) -> Option<[f64; 2]> {
        let spread = self.covariance()?;
        let of = |row: [f64; 2]| row[0] * self.right[0] + row[1] * self.right[1];
        Some([of(spread[0]), of(spread[1])])
    }

    /// Predicts a night with this covariate and with this standard deviation of its error.
    pub fn expects(&self, covariate: f64, deviation: f64) -> Option<Expected> {
        let spread = self.covariance()?;
        let [level, slope] = self.coefficients()?;
        let [one, x] = self.row(covariate);
        let leverage = spread[0][0] + 2.0 * x * spread[0][1] + x * x * spread[1][1];
        Some(Expected {
            value: one * level + x * slope,
            deviation: (deviation * deviation + leverage.max(0.0)).sqrt(),
        })
    }

    /// Returns the deviation of a night from its prediction as a normal deviate, 0 while too little is known. The
    /// scatter of the nights is learned with them (D. M. Hawkins, "Self-Starting Cusum Charts for Location and
    /// Scale", *The Statistician* 36, 1987), so the deviate is exact from the first night on.
    pub fn deviate(&self, estimate: &Estimate, covariate: f64) -> f64 {
        let Some(expected) = self.expects(covariate, estimate.deviation()) else {
            return 0.0;
        };
        if self.count < 2 {
            return 0.0;
        }
        let t = (estimate.value - expected.value) / (expected.deviation * self.scatter());
        normal_deviate(t, self.count as f64)
    }

    /// Scatter of the nights, as a multiple of that given by their intervals.
    pub fn scatter(&self) -> f64 {
        if self.count == 0 {
            return 1.0;
        }
        (self.squares / self.count as f64).max(1e-12).sqrt()
    }

    /// Learns a night.
    pub fn learn(&mut self, estimate: &Estimate, covariate: f64) {
        let deviation = estimate.deviation();
        // The scatter follows only from more nights than coefficients.
        if self.learned > usize::from(self.has_slope)
            && let Some(expected) = self.expects(covariate, deviation)
        {
            let off = (estimate.value - expected.value) / expected.deviation;
            self.squares += off * off;
            self.count += 1;
        }
        let row = self.row(covariate);
        let weight = deviation.powi(-2);
        for (a, left) in row.into_iter().enumerate() {
            for (b, right) in row.into_iter().enumerate() {
                self.information[a][b] += weight * left * right;
            }
            self.right[a] += weight * left * estimate.value;
        }
        self.learned += 1;
    }
}

/// Transforms Student's t with `freedom` degrees of freedom to the normal deviate of equal probability: D. L.
/// Wallace, "Bounds on Normal Approximations to Student's and the Chi-Square Distributions", *Annals of Mathematical
/// Statistics* 30, 1959, section 2.
fn normal_deviate(t: f64, freedom: f64) -> f64 {
    let size = (freedom * (1.0 + t * t / freedom).ln()).sqrt();
    t.signum() * size * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_of_students_t_is_that_of_the_normal_distribution() {
        // The 99.95 % quantiles: t with 10 and 30 degrees, and normal.
        assert!((normal_deviate(4.587, 10.0) - 3.291).abs() < 0.02);
        assert!((normal_deviate(-3.646, 30.0) + 3.291).abs() < 0.01);
    }

    #[test]
    fn a_temperature_that_was_never_seen_widens_what_is_expected() {
        let mut reference = Reference::new(0.03, 25.0);
        for night in 0..30 {
            let estimate = Estimate {
                day: f64::from(night),
                value: 1.0,
                low: 0.98,
                high: 1.02,
                temperature_c: None,
                hours_since_start: None,
            };
            reference.learn(&estimate, 25.0 + f64::from(night % 2));
        }
        let near = reference.expects(25.5, 0.01).unwrap().deviation;
        let far = reference.expects(45.0, 0.01).unwrap().deviation;
        assert!(far > 3.0 * near, "{near} {far}");
    }
}
