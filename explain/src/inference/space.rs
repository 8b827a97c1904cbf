//! Rows, whitening filters and nuisances: what turns signals into products that can be compared.
//!
//! All products of a column are formed after whitening, and with the nuisances projected out under their standard normal
//! priors, so that whoever uses them needs to know neither.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::least_squares::dot;
use crate::parallel;

use super::noise::Whitener;
use super::rows::Rows;

/// Columns that are projected on the nuisances together. Resolution: changes the computing time.
const BLOCK: usize = 16;

/// A whitened column, with the nuisances projected out of its products.
#[derive(Debug)]
pub struct Whitened {
    joint: Option<usize>,
    values: Vec<f64>,
    projected: DVector<f64>,
    /// Product with the measurement.
    pub right: f64,
}

/// A whitened measurement.
#[derive(Debug)]
pub struct Measured {
    values: Vec<f64>,
    projected: DVector<f64>,
}

/// Rows, filters and nuisances of all joints: what turns signals into whitened products.
#[derive(Debug)]
pub struct Space {
    pub(super) rows: Vec<Rows>,
    filters: Vec<Whitener>,
    /// Index of each joint's first row in a whitened signal.
    pub(super) first: Vec<usize>,
    pub(super) nuisances: Vec<(Option<usize>, Vec<f64>)>,
    /// By joint, its nuisances as rows: index in `nuisances`, and values.
    of_joint: Vec<(Vec<usize>, DMatrix<f64>)>,
    factor: Cholesky<f64, Dyn>,
    rows_of_problem: usize,
    /// Square of each joint's measured effort, whitened.
    pub(super) effort_squares: Vec<f64>,
}

impl Space {
    /// The space of some rows, whose nuisances are `nuisances` at one standard deviation.
    pub fn new(
        problem: &Problem,
        rows: Vec<Rows>,
        filters: Vec<Whitener>,
        nuisances: &[&Column],
    ) -> Self {
        let mut first = vec![0];
        for own in &rows {
            first.push(first[first.len() - 1] + own.len());
        }
        let count = nuisances.len();
        let mut space = Self {
            rows,
            filters,
            first,
            nuisances: Vec::new(),
            of_joint: Vec::new(),
            factor: Cholesky::new(DMatrix::identity(1, 1)).unwrap_or_else(|| unreachable!()),
            rows_of_problem: problem.rows,
            effort_squares: Vec::new(),
        };
        let of_joint = |joint: usize| {
            let values = problem.measured[problem.joint_rows(joint)].to_vec();
            let joint = Some(joint);
            let own = space.whitened(&Column { joint, values }, 1.0);
            dot(&own, &own)
        };
        space.effort_squares = (0..problem.joints).map(of_joint).collect();
        space.nuisances = parallel::map(nuisances, |c| (c.joint, space.whitened(c, 1.0)));
        let joints: Vec<usize> = (0..problem.joints).collect();
        space.of_joint = parallel::map(&joints, |&joint| space.rows_of(joint));
        let products = parallel::map(&space.of_joint, |(_, rows)| rows * rows.transpose());
        let mut normal = DMatrix::identity(count, count);
        for ((index, _), product) in space.of_joint.iter().zip(&products) {
            for (a, &i) in index.iter().enumerate() {
                for (b, &j) in index.iter().enumerate() {
                    normal[(i, j)] += product[(a, b)];
                }
            }
        }
        space.factor = Cholesky::new(normal).unwrap_or_else(|| {
            Cholesky::new(DMatrix::identity(count, count)).unwrap_or_else(|| unreachable!())
        });
        space
    }

    /// The nuisances that a joint feels, as rows.
    fn rows_of(&self, joint: usize) -> (Vec<usize>, DMatrix<f64>) {
        let range = self.first[joint]..self.first[joint + 1];
        let felt = self.nuisances.iter().enumerate().filter_map(|(i, own)| {
            let values = match own.0 {
                None => &own.1[range.clone()],
                Some(only) if only == joint => &own.1,
                Some(_) => return None,
            };
            Some((i, values))
        });
        let felt: Vec<(usize, &[f64])> = felt.collect();
        let rows = DMatrix::from_fn(felt.len(), range.len(), |a, k| felt[a].1[k]);
        (felt.into_iter().map(|(i, _)| i).collect(), rows)
    }

    /// A measurement, whitened.
    pub fn measured(&self, column: &Column) -> Measured {
        let values = self.whitened(column, 1.0);
        let projected = self.project(None, &values);
        Measured { values, projected }
    }

    /// Columns times their scales, with their products with a measurement.
    pub fn columns(&self, columns: &[(&Column, f64)], measured: &Measured) -> Vec<Whitened> {
        let values: Vec<Vec<f64>> = columns
            .iter()
            .map(|(c, scale)| self.whitened(c, *scale))
            .collect();
        let all: Vec<(Option<usize>, &[f64])> = columns
            .iter()
            .zip(&values)
            .map(|((c, _), values)| (c.joint, &**values))
            .collect();
        let projected = self.projections(&all);
        let pairs = columns.iter().zip(values).zip(projected.column_iter());
        let whitened = pairs.map(|(((column, _), values), projected)| {
            let with_measured = self.dot((column.joint, &values), (None, &measured.values));
            let projected = projected.into_owned();
            Whitened {
                joint: column.joint,
                right: with_measured - projected.dot(&measured.projected),
                values,
                projected,
            }
        });
        whitened.collect()
    }

    /// Product of two columns.
    pub fn product(&self, a: &Whitened, b: &Whitened) -> f64 {
        self.dot((a.joint, &a.values), (b.joint, &b.values)) - a.projected.dot(&b.projected)
    }

    /// Whitens a column: its rows at its joint, or at all joints one after the other.
    pub(super) fn whitened(&self, column: &Column, scale: f64) -> Vec<f64> {
        let joints = match column.joint {
            Some(joint) => joint..joint + 1,
            None => 0..self.rows.len(),
        };
        let mut all = Vec::new();
        for joint in joints {
            let Some(values) = column.of_joint(joint, self.rows_of_problem) else {
                continue;
            };
            let mut picked = self.rows[joint].pick(values);
            for x in &mut picked {
                *x *= scale;
            }
            self.filters[joint].apply(&mut picked);
            all.extend(picked);
        }
        all
    }

    fn dot(&self, a: (Option<usize>, &[f64]), b: (Option<usize>, &[f64])) -> f64 {
        let part = |joint: usize| self.first[joint]..self.first[joint + 1];
        match (a.0, b.0) {
            (Some(i), Some(j)) if i != j => 0.0,
            (Some(_), Some(_)) | (None, None) => dot(a.1, b.1),
            (Some(i), None) => dot(a.1, &b.1[part(i)]),
            (None, Some(j)) => dot(&a.1[part(j)], b.1),
        }
    }

    fn project(&self, joint: Option<usize>, values: &[f64]) -> DVector<f64> {
        self.projections(&[(joint, values)]).column(0).into_owned()
    }

    /// Projections of signals on the nuisances, a column each: matrix products, joint by joint.
    fn projections(&self, signals: &[(Option<usize>, &[f64])]) -> DMatrix<f64> {
        let mut right = DMatrix::zeros(self.nuisances.len(), signals.len());
        for (joint, (index, rows)) in self.of_joint.iter().enumerate() {
            let range = self.first[joint]..self.first[joint + 1];
            let felt = signals
                .iter()
                .enumerate()
                .filter_map(|(k, (only, values))| match only {
                    None => Some((k, &values[range.clone()])),
                    Some(only) => (*only == joint).then_some((k, *values)),
                });
            let felt: Vec<(usize, &[f64])> = felt.collect();
            let own = felt
                .iter()
                .map(|(_, values)| DVector::from_column_slice(values));
            let own: Vec<DVector<f64>> = own.collect();
            if own.is_empty() {
                continue;
            }
            let products = rows * DMatrix::from_columns(&own);
            for (b, (k, _)) in felt.iter().enumerate() {
                for (a, &i) in index.iter().enumerate() {
                    right[(i, *k)] += products[(a, b)];
                }
            }
        }
        self.factor.l_dirty().solve_lower_triangular_mut(&mut right);
        right
    }

    /// Products of some columns among each other and with the residual, nuisances projected out.
    pub fn products(&self, columns: &[&Column], residual: &Column) -> Products {
        let measured = self.measured(residual);
        let unscaled: Vec<(&Column, f64)> = columns.iter().map(|column| (*column, 1.0)).collect();
        let blocks: Vec<&[(&Column, f64)]> = unscaled.chunks(BLOCK).collect();
        let all = parallel::map(&blocks, |block| self.columns(block, &measured));
        let all: Vec<Whitened> = all.into_iter().flatten().collect();
        let count = columns.len();
        let mut normal = DMatrix::zeros(count, count);
        for (a, column) in all.iter().enumerate() {
            for (b, other) in all[..=a].iter().enumerate() {
                let product = self.product(column, other);
                normal[(a, b)] = product;
                normal[(b, a)] = product;
            }
        }
        Products {
            normal,
            right: DVector::from_iterator(count, all.iter().map(|column| column.right)),
            of_residual: measured.projected,
        }
    }

    /// Whitens a joint's part of a signal, by piece of a recording.
    pub fn whitened_by_piece(&self, joint: usize, values: &[f64], pieces: usize) -> Vec<Vec<f64>> {
        let rows = &self.rows[joint];
        let mut picked = rows.pick(values);
        self.filters[joint].apply(&mut picked);
        let mut all = vec![Vec::new(); pieces];
        for (value, piece) in picked.into_iter().zip(&rows.piece) {
            all[*piece].push(value);
        }
        all
    }

    /// Logarithm of the marginal likelihood of a measurement that only nuisances and noise make, up to a constant \[nats\].
    pub fn evidence(&self, measured: &Column) -> f64 {
        let log_det: f64 = self
            .factor
            .l_dirty()
            .diagonal()
            .iter()
            .map(|d| d.ln())
            .sum();
        let noise: f64 = self.filters.iter().map(|filter| filter.half_log_det).sum();
        -0.5 * self.square(measured) - log_det - noise
    }

    /// Square of a residual, with the best nuisances taken out of it under their priors.
    pub fn square(&self, residual: &Column) -> f64 {
        let y = self.whitened(residual, 1.0);
        dot(&y, &y) - self.project(None, &y).norm_squared()
    }

    /// Whitened residual of each joint's rows, the best nuisances taken out.
    pub fn innovations(&self, residual: &Column) -> Vec<Vec<f64>> {
        let mut y = self.whitened(residual, 1.0);
        let means = self.means(self.project(None, &y));
        for ((joint, values), mean) in self.nuisances.iter().zip(means.iter()) {
            let first = joint.map_or(0, |joint| self.first[joint]);
            y[first..]
                .iter_mut()
                .zip(values)
                .for_each(|(y, x)| *y -= mean * x);
        }
        self.first
            .windows(2)
            .map(|pair| y[pair[0]..pair[1]].to_vec())
            .collect()
    }

    /// Means of the nuisances from their projection.
    pub fn means(&self, mut projection: DVector<f64>) -> DVector<f64> {
        self.factor
            .l_dirty()
            .tr_solve_lower_triangular_mut(&mut projection);
        projection
    }
}

/// Products of columns and residual, see [`Space::products`].
#[derive(Debug)]
pub struct Products {
    /// Columns with columns.
    pub normal: DMatrix<f64>,
    /// Columns with the residual.
    pub right: DVector<f64>,
    /// Projection of the residual on the nuisances.
    pub of_residual: DVector<f64>,
}
