//! Numbers on which recordings disagree.

use nalgebra::DMatrix;

/// Recordings disagree on a number if they differ by more than chance makes 99 times of 100.
/// Statistical: the 99 % quantile of the standard normal distribution, which gives that of the chi-square distribution.
const SELDOM: f64 = 2.326;

/// By how much each recording pulls each number, in first order: what the number would change by without it, less what all
/// recordings pull it by in the mean.
pub(super) struct Disagreement {
    /// One row for each number, one column for each recording.
    pulls: DMatrix<f64>,
}

impl Disagreement {
    /// From the pulls, one row for each number, one column for each recording.
    pub(super) fn of(mut pulls: DMatrix<f64>) -> Self {
        for mut row in pulls.row_iter_mut() {
            let mean = row.mean();
            row.add_scalar_mut(-mean);
        }
        Self { pulls }
    }

    /// The variance of a number by what recordings disagree by (the infinitesimal jackknife with recordings as its
    /// groups; Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, section 11.5), if it is more than chance
    /// makes of `variance`; zero otherwise. The quantile of the chi-square distribution is that of Wilson and Hilferty
    /// (1931).
    pub(super) fn beyond_chance(&self, number: usize, variance: f64) -> f64 {
        let recordings = self.pulls.ncols();
        if recordings < 2 {
            return 0.0;
        }
        let freedom = (recordings - 1) as f64;
        let disagreement = self.pulls.row(number).norm_squared() * recordings as f64 / freedom;
        let scale = 2.0 / (9.0 * freedom);
        let by_chance = (1.0 - scale + SELDOM * scale.sqrt()).powi(3);
        if disagreement > by_chance * variance {
            disagreement
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beyond(pulls: &[f64]) -> f64 {
        let pulls = DMatrix::from_row_slice(1, pulls.len(), pulls);
        Disagreement::of(pulls).beyond_chance(0, 1.0)
    }

    #[test]
    fn recordings_that_differ_by_chance_disagree_on_nothing() {
        assert!(beyond(&[0.5, -0.5]) <= 0.0);
        assert!(beyond(&[0.9, -0.4, -0.5, 0.1]) <= 0.0);
        assert!(beyond(&[9.0]) <= 0.0);
    }

    #[test]
    fn recordings_that_differ_by_more_widen_the_number_to_what_they_differ_by() {
        // Two recordings that say 10 apart: their mean is off by 5.
        let two = beyond(&[2.5, -2.5]);
        assert!((two.sqrt() - 5.0).abs() < 1e-9, "{two}");
        assert!(beyond(&[4.0, -1.0, -2.0, -1.0]) > 20.0);
    }
}
