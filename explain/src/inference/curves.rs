//! Curves of a joint's effort over what may act on it: what is described without a law.
//!
//! The values of a curve are correlated beforehand, those of near knots most: a Gaussian process with a squared exponential
//! covariance (Rasmussen and Williams, *Gaussian Processes for Machine Learning*, 2006, section 4.2). So a smooth curve
//! costs little more than a law.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{Table, UNKNOWN};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Hypothesis, Whereabouts, held_knots};
use crate::propose::curve_axes::{curves, knot_columns};

/// Length over which values are correlated, in mean distances of the knots.
/// Resolution: between knots that are farther apart than the length, a curve would be free to do what no knot describes.
const LENGTH: f64 = 2.0;
/// Share of the variance that is independent from knot to knot. Chosen: a tenth, so that a curve may have a corner.
const ROUGH_SHARE: f64 = 0.1;

/// A curve with the prior of its values.
#[derive(Debug, Clone)]
pub struct Curve {
    /// The effect that it is.
    pub hypothesis: Hypothesis,
    /// Its knots and what it is a function of.
    pub table: Table,
    /// Values at the free knots by unit of each factor: the Cholesky factor of their correlation.
    mixing: DMatrix<f64>,
}

impl Curve {
    /// The curve over these knots.
    pub fn new(table: Table, hypothesis: Hypothesis) -> Self {
        let held = held_knots(&table, hypothesis.place.joint);
        let free: Vec<f64> = (table.knots.iter().enumerate())
            .filter(|(k, _)| !held.contains(k))
            .map(|(_, x)| *x)
            .collect();
        let (low, high) = (free.iter()).fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(*x), high.max(*x))
        });
        let count = free.len();
        let distance = (high - low) / (count.max(2) - 1) as f64;
        let length = (LENGTH * distance).max(f64::MIN_POSITIVE);
        let correlation = DMatrix::from_fn(count, count, |a, b| {
            let smooth = (-0.5 * ((free[a] - free[b]) / length).powi(2)).exp();
            (1.0 - ROUGH_SHARE) * smooth + if a == b { ROUGH_SHARE } else { 0.0 }
        });
        let mixing = correlation
            .cholesky()
            .map_or_else(|| DMatrix::identity(count, count), |factor| factor.l());
        Self {
            hypothesis,
            table,
            mixing,
        }
    }

    /// The curve with these factors.
    pub fn with(&self, factors: &[f64]) -> Active {
        let values = &self.mixing * DVector::from_column_slice(factors);
        Active {
            hypothesis: self.hypothesis,
            coordinates: values.as_slice().to_vec(),
            curve: Some(self.table.clone()),
        }
    }

    /// The factors of these values at the free knots.
    pub fn factors(&self, values: &[f64]) -> Vec<f64> {
        let mut factors = DVector::from_column_slice(values);
        self.mixing.solve_lower_triangular_mut(&mut factors);
        factors.as_slice().to_vec()
    }

    /// The columns of the factors from those of the values.
    pub fn mixed(&self, columns: &[Arc<Column>]) -> Vec<Arc<Column>> {
        let of = |c: usize| {
            let mut mixed = columns[c].times(self.mixing[(c, c)]);
            for (k, column) in columns.iter().enumerate().skip(c + 1) {
                for (mixed, x) in mixed.values.iter_mut().zip(&column.values) {
                    *mixed += self.mixing[(k, c)] * x;
                }
            }
            Arc::new(mixed)
        };
        (0..columns.len()).map(of).collect()
    }
}

/// The curves that are tried at a joint, with their columns.
pub fn of_joint(problem: &Problem, fit: &Fit, joint: usize) -> Vec<(Curve, Vec<Arc<Column>>)> {
    let place = Whereabouts {
        joint,
        ..Whereabouts::default()
    };
    let hypothesis = Hypothesis {
        effect: &UNKNOWN,
        place,
    };
    let mut tables = curves(problem, joint);
    // Friction that follows no law may as well be the other simulation's.
    let is_told = |table: &Table| !(problem.is_foreign && table.by_direction);
    tables.retain(is_told);
    let of = |table: Table| {
        let curve = Curve::new(table, hypothesis);
        let free = curve.mixing.nrows();
        if free == 0 {
            return None;
        }
        let columns = knot_columns(problem, fit, &curve.with(&vec![0.0; free]));
        Some((curve, columns.into_iter().map(Arc::new).collect()))
    };
    tables.into_iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use tauscope_dynamics::terms::Against;

    use super::*;

    #[test]
    fn a_curve_keeps_its_values() {
        let table = Table {
            against: Against::Position,
            of_joint: 0,
            by_direction: false,
            period: None,
            knots: vec![-1.0, -0.2, 0.3, 1.1],
            values: vec![0.0; 4],
        };
        let hypothesis = Hypothesis {
            effect: &UNKNOWN,
            place: Whereabouts::default(),
        };
        let curve = Curve::new(table, hypothesis);
        let values = [0.3, -0.2, 0.9, 0.1];
        let again = curve.with(&curve.factors(&values)).coordinates;
        for (value, again) in values.iter().zip(again) {
            assert!((value - again).abs() < 1e-12);
        }
    }
}
