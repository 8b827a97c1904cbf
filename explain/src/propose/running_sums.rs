//! Normal equations over any interval of time, from sums over the rows before each bin.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;

/// Factors that are scanned. The inertias of a payload come after them and hardly change the effort.
/// Physical: a payload's mass and first moments of mass.
const SCANNED_FACTORS: usize = 4;
/// Added to the diagonal of an interval's normal equations, as a share of their trace.
/// Resolution: guards the factorisation of dependent columns.
const RIDGE: f64 = 1e-9;

/// Normal equations of some columns, summed over the rows of all bins before each.
pub struct Sums {
    gram: Vec<DMatrix<f64>>,
    right: Vec<DVector<f64>>,
}

impl Sums {
    /// Sums of the residual of a fit over bins; `bin_of` says which one a sample of a track is in.
    pub fn new(
        (problem, fit): (&Problem, &Fit),
        columns: &[Arc<Column>],
        tracks: &[usize],
        bins: usize,
        bin_of: impl Fn(usize, usize) -> usize,
    ) -> Self {
        let columns = &columns[..columns.len().min(SCANNED_FACTORS)];
        let q = columns.len();
        let mut gram = vec![DMatrix::<f64>::zeros(q, q); bins + 1];
        let mut right = vec![DVector::<f64>::zeros(q); bins + 1];
        for &r in tracks {
            let track = &problem.tracks[r];
            for (row, &k) in track.rows().zip(&track.compared) {
                let bin = bin_of(r, k) + 1;
                for j in 0..problem.joints {
                    let at = j * problem.rows + row;
                    let weight = problem.weight[at] / fit.variance[j];
                    if weight == 0.0 {
                        continue;
                    }
                    let value = |c: &Arc<Column>| {
                        let own = c.of_joint(j, problem.rows);
                        own.map_or(0.0, |values| values[row])
                    };
                    let x: DVector<f64> = DVector::from_iterator(q, columns.iter().map(value));
                    gram[bin].ger(weight, &x, &x, 1.0);
                    right[bin].axpy(weight * fit.residual[at], &x, 1.0);
                }
            }
        }
        for bin in 1..=bins {
            let (before, here) = gram.split_at_mut(bin);
            here[0] += &before[bin - 1];
            let (before, here) = right.split_at_mut(bin);
            here[0] += &before[bin - 1];
        }
        Self { gram, right }
    }

    /// Reduction of the squares by the best factors of these bins.
    pub fn gain(&self, bins: &Range<usize>) -> f64 {
        let mut normal = &self.gram[bins.end] - &self.gram[bins.start];
        let right = &self.right[bins.end] - &self.right[bins.start];
        let ridge = RIDGE * normal.trace() + f64::MIN_POSITIVE;
        for a in 0..right.len() {
            normal[(a, a)] += ridge;
        }
        let factor = normal.cholesky();
        factor.map_or(f64::NEG_INFINITY, |factor| right.dot(&factor.solve(&right)))
    }
}
