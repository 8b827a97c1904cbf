//! Normal equations of factors of which some cannot be negative.
//!
//! The posterior is the normal one with the factors that would be negative held at zero, where its density falls off
//! exponentially: the solution of the least-squares problem with bounds (Lawson and Hanson, *Solving Least Squares
//! Problems*, 1995, chapter 23), and Laplace's approximation about it. A product of each factor's own share above zero
//! would say too much: of two factors whose difference is uncertain each may well be positive, while their sum is
//! surely negative.

use nalgebra::{DMatrix, DVector};

use super::normal::{log_twice_share_above_zero, log_twice_tail};

/// A solution of normal equations with bounds.
pub struct Bounded {
    /// The unknowns that are not held at zero, ascending.
    pub free: Vec<usize>,
    /// Cholesky factor of the normal matrix of the free ones.
    pub lower: DMatrix<f64>,
    /// The right side of the free ones, solved by that factor.
    pub solved: DVector<f64>,
    /// The unknowns that are held at zero, and their variances there.
    pub held: Vec<(usize, f64)>,
    /// Part of the logarithm of the evidence that the held ones have \[nats\].
    of_held: f64,
}

impl Bounded {
    /// Solves `normal` x = `right` with x at least zero where `positive`; nothing if the matrix cannot be factored.
    pub fn new(
        normal: &DMatrix<f64>,
        right: &DVector<f64>,
        positive: &dyn Fn(usize) -> bool,
    ) -> Option<Self> {
        let count = right.len();
        let mut is_free = vec![true; count];
        // Each exchange lowers the sum of squares but for rounding, so few are needed.
        for _ in 0..=2 * count {
            let free: Vec<usize> = (0..count).filter(|&i| is_free[i]).collect();
            let own = normal.select_rows(&free).select_columns(&free);
            let lower = own.cholesky()?.unpack();
            let mut solved = right.select_rows(&free);
            lower.solve_lower_triangular_mut(&mut solved);
            let mut mean = solved.clone();
            lower.tr_solve_lower_triangular_mut(&mut mean);
            let below = (free.iter().zip(mean.iter())).filter(|(i, x)| positive(**i) && **x < 0.0);
            if let Some((&lowest, _)) = below.min_by(|a, b| {
                let scaled = |(i, x): &(&usize, &f64)| **x * normal[(**i, **i)].sqrt();
                scaled(a).total_cmp(&scaled(b))
            }) {
                is_free[lowest] = false;
                continue;
            }
            let slope = |i: usize| -> f64 {
                let others = free.iter().zip(mean.iter());
                right[i] - others.map(|(&j, x)| normal[(i, j)] * x).sum::<f64>()
            };
            let rises = (0..count).filter(|&i| !is_free[i] && slope(i) > 0.0);
            if let Some(steepest) = rises.max_by(|&a, &b| slope(a).total_cmp(&slope(b))) {
                is_free[steepest] = true;
                continue;
            }
            let mut held = Vec::new();
            let mut of_held = 0.0;
            for i in (0..count).filter(|&i| !is_free[i]) {
                let mut cross = DVector::from_fn(free.len(), |k, _| normal[(free[k], i)]);
                lower.solve_lower_triangular_mut(&mut cross);
                let precision = (normal[(i, i)] - cross.norm_squared()).max(f64::MIN_POSITIVE);
                let slope = slope(i);
                of_held += log_twice_tail(slope / precision.sqrt()) - 0.5 * precision.ln();
                held.push((i, 1.0 / (precision + slope * slope)));
            }
            return Some(Self {
                free,
                lower,
                solved,
                held,
                of_held,
            });
        }
        None
    }

    /// Means of all unknowns, and a matrix whose rows' products are their covariances: one row for each.
    pub fn mean_and_half(&self) -> (DVector<f64>, DMatrix<f64>) {
        let (count, p) = (self.free.len() + self.held.len(), self.free.len());
        let (own, half) = self.of_free();
        let mut mean = DVector::zeros(count);
        let mut all = DMatrix::zeros(count, p + self.held.len());
        for (k, &i) in self.free.iter().enumerate() {
            mean[i] = own[k];
            all.row_mut(i).columns_mut(0, p).copy_from(&half.row(k));
        }
        for (k, (i, variance)) in self.held.iter().enumerate() {
            all[(*i, p + k)] = variance.sqrt();
        }
        (mean, all)
    }

    /// Means of the free unknowns, and the inverse of their factor.
    pub fn of_free(&self) -> (DVector<f64>, DMatrix<f64>) {
        let inverse = inverse_of_lower(&self.lower).transpose();
        (&inverse * &self.solved, inverse)
    }

    /// Logarithm of the evidence with normal priors of variance one, half-normal where `positive` \[nats\]. `mean` and `half`
    /// are those of all unknowns.
    pub fn evidence(
        &self,
        mean: &DVector<f64>,
        half: &DMatrix<f64>,
        positive: &dyn Fn(usize) -> bool,
    ) -> f64 {
        let shares = self.free.iter().filter(|i| positive(**i));
        let shares = shares.map(|&i| log_twice_share_above_zero(mean[i] / half.row(i).norm()));
        0.5 * self.solved.norm_squared() - self.lower.diagonal().map(f64::ln).sum()
            + shares.sum::<f64>()
            + self.of_held
    }
}

/// Inverse of a lower triangular matrix. Its columns begin at the diagonal, which a general solver does not know.
fn inverse_of_lower(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let p = lower.nrows();
    let mut inverse = DMatrix::zeros(p, p);
    for j in 0..p {
        let mut column = inverse.column_mut(j);
        column[j] = 1.0;
        for k in j..p {
            let x = column[k] / lower[(k, k)];
            column[k] = x;
            let below = p - k - 1;
            column
                .rows_mut(k + 1, below)
                .axpy(-x, &lower.column(k).rows(k + 1, below), 1.0);
        }
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(normal: [f64; 4], right: [f64; 2]) -> f64 {
        let normal = DMatrix::from_row_slice(2, 2, &normal);
        let right = DVector::from_column_slice(&right);
        let all = |_: usize| true;
        let bounded = Bounded::new(&normal, &right, &all).unwrap();
        let (mean, half) = bounded.mean_and_half();
        assert!(mean.min() >= 0.0);
        bounded.evidence(&mean, &half, &all)
    }

    /// The evidence by a sum over a grid.
    fn summed(normal: [f64; 4], right: [f64; 2]) -> f64 {
        let step = 0.002;
        let mut sum = 0.0;
        for i in 0..3000 {
            for j in 0..3000 {
                let (x, y) = (step * (f64::from(i) + 0.5), step * (f64::from(j) + 0.5));
                let square = normal[0] * x * x + 2.0 * normal[1] * x * y + normal[3] * y * y;
                sum += (right[0] * x + right[1] * y - 0.5 * square).exp();
            }
        }
        // Two half-normal priors, whose squares the matrix has.
        (sum * step * step * 4.0 / std::f64::consts::TAU).ln()
    }

    #[test]
    fn a_triangular_matrix_times_its_inverse_is_one() {
        let lower = DMatrix::from_fn(5, 5, |i, j| {
            if i < j {
                0.0
            } else {
                1.0 + (i * 3 + j) as f64 % 4.0
            }
        });
        let one = &lower * inverse_of_lower(&lower);
        assert!((one - DMatrix::identity(5, 5)).amax() < 1e-12);
    }

    #[test]
    fn the_evidence_of_two_factors_is_that_of_a_sum_over_both() {
        for (normal, right) in [
            ([5.0, 1.0, 1.0, 8.0], [9.0, 12.0]),
            ([5.0, 1.0, 1.0, 8.0], [9.0, -6.0]),
            ([20.0, 18.0, 18.0, 20.0], [-15.0, -15.0]),
            ([20.0, 18.0, 18.0, 20.0], [12.0, -8.0]),
        ] {
            let (found, exact) = (evidence(normal, right), summed(normal, right));
            assert!((found - exact).abs() < 0.7, "{found}, {exact}");
        }
    }

    /// Guards against friction that gained thousands of nats by two coefficients whose sum is surely negative.
    #[test]
    fn factors_that_would_be_negative_gain_nothing() {
        let (n, r) = (1000.0, -800.0);
        assert!(evidence([n + 1.0, n, n, n + 1.0], [r, r]) < 0.0);
    }
}
