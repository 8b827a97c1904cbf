//! Waves over a joint's angle that do not close after a revolution, put right to whole numbers of cycles.
//!
//! Where a joint turns by less than a revolution, and beside something that is not explained, the number of cycles is found a
//! little off. A whole number that does nearly as well is what a gear makes.

use nalgebra::{DMatrix, DVector};

use crate::data::column::Column;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis};
use crate::select::explanation::Explanation;
use crate::select::plausible::is_open_wave;
use crate::select::search::Search;

/// Added to the scaled products of the columns, whose diagonal is 1.
/// Resolution: guards the inverse of dependent columns.
const RIDGE: f64 = 1e-9;

impl Search<'_> {
    /// The explanation with the waves `names` of a joint closed: all of them with whole numbers of cycles. `None` if they do
    /// not close so, or two of them are one then.
    pub fn with_closed_waves(
        &self,
        best: &Explanation,
        names: &[usize],
        joint: usize,
    ) -> Option<Explanation> {
        let waves: Vec<usize> = (names.iter().copied())
            .filter(|&i| best.fit.actives[i].hypothesis.is_wave())
            .collect();
        let whole = |&i: &usize| {
            let mut wave = best.fit.actives[i].clone();
            if is_open_wave(&wave) {
                wave.coordinates[2] = wave.coordinates[2].round();
            }
            wave
        };
        let closed: Vec<Active> = waves.iter().map(whole).collect();
        let is_same = |pair: &[Active]| pair[0].coordinates[2..] == pair[1].coordinates[2..];
        let mut other: Vec<Active> = closed.clone();
        other.sort_by(|a, b| a.coordinates[2].total_cmp(&b.coordinates[2]));
        if closed.is_empty() || closed.iter().any(is_open_wave) || other.windows(2).any(is_same) {
            return None;
        }
        let mut actives = best.fit.actives.clone();
        for &i in waves.iter().rev() {
            actives.remove(i);
        }
        let less = Fit::new(self.problem, actives);
        let factors = self.factors(&less, &closed, joint)?;
        let mut actives = best.fit.actives.clone();
        for ((&i, mut wave), factors) in waves.iter().zip(closed).zip(factors.chunks(2)) {
            wave.coordinates[..2].copy_from_slice(factors);
            actives[i] = wave;
        }
        Some(Explanation {
            fit: Fit::new(self.problem, actives),
            penalties: best.penalties.clone(),
        })
    }

    /// The factors of sine and cosine of waves that together fit what `less` leaves at a joint.
    fn factors(&self, less: &Fit, waves: &[Active], joint: usize) -> Option<Vec<f64>> {
        let own = self.problem.joint_rows(joint);
        let (residual, weight) = (&less.residual[own.clone()], &self.problem.weight[own]);
        let mut columns: Vec<Vec<f64>> = Vec::new();
        for wave in waves {
            let of: Hypothesis = wave.hypothesis;
            for column in &less.columns(self.problem, of, &wave.coordinates).factors {
                let column: &Column = column;
                columns.push(column.of_joint(joint, self.problem.rows)?.to_vec());
            }
        }
        let product = |x: &[f64], y: &[f64]| -> f64 {
            let each = x.iter().zip(y).zip(weight);
            each.map(|((x, y), weight)| weight * x * y).sum()
        };
        let count = columns.len();
        let scale = |x: &Vec<f64>| product(x, x).max(f64::MIN_POSITIVE).sqrt();
        let scale: Vec<f64> = columns.iter().map(scale).collect();
        let normal = DMatrix::from_fn(count, count, |a, b| {
            let ridge = if a == b { RIDGE } else { 0.0 };
            ridge + product(&columns[a], &columns[b]) / (scale[a] * scale[b])
        });
        let each = columns.iter().zip(&scale);
        let right = each.map(|(x, scale)| product(x, residual) / scale);
        let right = DVector::from_iterator(count, right);
        let solution = normal.cholesky()?.solve(&right);
        Some(
            solution
                .iter()
                .zip(&scale)
                .map(|(x, scale)| x / scale)
                .collect(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn waves_that_are_a_little_off_are_closed_with_the_factors_that_fit() {
        let problem = problem_with(3, |q, _, effort| {
            effort[1] += 1.2 * (16.0 * q[1] + 0.3).sin() + 0.8 * (12.0 * q[1]).sin();
        });
        let search = Search {
            problem: &problem,
            hypotheses: &[],
            unnamed_bodies: &[],
            say: &|_| {},
        };
        let closed = |cycles: [f64; 2]| {
            let ripple = at_joint("torque_ripple", 1);
            let waves = cycles.map(|n| ripple.with(vec![-1.0, 0.1, n])).to_vec();
            let found = Explanation {
                fit: Fit::new(&problem, waves),
                penalties: vec![0.0; 2],
            };
            search.with_closed_waves(&found, &[0, 1], 1)
        };
        let found = closed([16.31, 12.27]).expect("they close");
        let [first, second] = [0, 1].map(|i| found.fit.actives[i].parameters());
        assert!(
            (first[0] - 1.2).abs() < 0.02 && (second[0] - 0.8).abs() < 0.02,
            "{first:?} {second:?}"
        );
        assert!((first[1] - 16.0).abs() < 1e-12 && (second[1] - 12.0).abs() < 1e-12);
        assert!(found.fit.variance[1] < 2.0 * problem.white_noise[1].powi(2));
        // Two waves of one number of cycles are one wave.
        assert!(closed([16.31, 15.8]).is_none());
    }
}
