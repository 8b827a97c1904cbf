//! Predictions of pieces of recordings that are left out of the fit in turn.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::data::column::Column;
use crate::fit::least_squares::dot;
use crate::parallel;

use super::space::Space;

/// The coefficients that the other pieces give, for each piece.
pub struct LeftOut<'a> {
    space: &'a Space,
    /// Nuisances, then columns, then the measurement, whitened.
    columns: Vec<(Option<usize>, Vec<f64>)>,
    /// By piece, the factor of the coefficients' precision without it, and their means.
    without: Vec<(Cholesky<f64, Dyn>, DVector<f64>)>,
}

impl<'a> LeftOut<'a> {
    /// Fits all nuisances of a space and some `columns`, scaled by their prior standard deviations, to all pieces but
    /// one; nothing where a normal matrix cannot be factored.
    pub fn new(
        space: &'a Space,
        columns: &[Column],
        measured: &Column,
        pieces: usize,
    ) -> Option<Self> {
        let mut all: Vec<(Option<usize>, Vec<f64>)> = space.nuisances.clone();
        all.extend(parallel::map(columns, |c| {
            (c.joint, space.whitened(c, 1.0))
        }));
        all.push((None, space.whitened(measured, 1.0)));
        let mut fits = Self {
            space,
            columns: all,
            without: Vec::new(),
        };
        let grams: Vec<DMatrix<f64>> = (0..pieces).map(|piece| fits.gram(piece)).collect();
        let p = fits.columns.len() - 1;
        let whole = grams
            .iter()
            .fold(DMatrix::zeros(p + 1, p + 1), |sum, gram| sum + gram);
        let of_piece = |gram: &DMatrix<f64>| {
            let others = &whole - gram;
            let mut normal = others.view((0, 0), (p, p)).into_owned();
            for i in 0..p {
                normal[(i, i)] += 1.0;
            }
            let factor = normal.cholesky()?;
            let means = factor.solve(&others.view((0, p), (p, 1)).column(0));
            Some((factor, means))
        };
        let without = parallel::map(&grams, of_piece);
        fits.without = without.into_iter().collect::<Option<_>>()?;
        Some(fits)
    }

    /// Rows of a joint in a piece: they follow each other.
    fn rows(&self, joint: usize, piece: usize) -> std::ops::Range<usize> {
        let of = &self.space.rows[joint].piece;
        of.partition_point(|p| *p < piece)..of.partition_point(|p| *p <= piece)
    }

    /// A column at the rows of a joint in a piece; nothing where it has none.
    fn part(&self, column: usize, joint: usize, piece: usize) -> Option<&[f64]> {
        let (only, values) = &self.columns[column];
        let first = match only {
            Some(other) if *other != joint => return None,
            Some(_) => 0,
            None => self.space.first[joint],
        };
        Some(&values[first..][self.rows(joint, piece)])
    }

    /// Products of all columns over the rows of a piece.
    fn gram(&self, piece: usize) -> DMatrix<f64> {
        let count = self.columns.len();
        let joints = self.space.rows.len();
        let of = |&a: &usize| -> Vec<f64> {
            let with = |b: usize| {
                let product = |joint: usize| {
                    let (x, y) = (self.part(a, joint, piece)?, self.part(b, joint, piece)?);
                    Some(dot(x, y))
                };
                (0..joints).filter_map(product).sum::<f64>()
            };
            (0..=a).map(with).collect()
        };
        let products = parallel::map(&(0..count).collect::<Vec<_>>(), of);
        DMatrix::from_fn(count, count, |a, b| products[a.max(b)][a.min(b)])
    }

    /// Number of nuisances: the columns begin behind them.
    pub fn nuisances(&self) -> usize {
        self.space.nuisances.len()
    }

    /// Whitened residual of a joint in a piece, with the coefficients that the other pieces give the columns for which
    /// `is_counted` holds.
    pub fn residual(
        &self,
        joint: usize,
        piece: usize,
        is_counted: &dyn Fn(usize) -> bool,
    ) -> DVector<f64> {
        let p = self.columns.len() - 1;
        let measured = self.part(p, joint, piece).unwrap_or_default();
        let mut left = DVector::from_column_slice(measured);
        let numbers = self.without[piece].1.iter().enumerate();
        for (a, number) in numbers.filter(|(a, _)| is_counted(*a)) {
            let values = self.part(a, joint, piece).unwrap_or_default();
            left.iter_mut()
                .zip(values)
                .for_each(|(left, x)| *left -= number * x);
        }
        left
    }

    /// Covariance of the products of that residual with some features (rows by features), if noise and coefficients are as
    /// the model has them.
    pub fn covariance(&self, joint: usize, piece: usize, features: &DMatrix<f64>) -> DMatrix<f64> {
        let p = self.columns.len() - 1;
        let mut cross = DMatrix::zeros(p, features.ncols());
        for a in 0..p {
            if let Some(values) = self.part(a, joint, piece) {
                for (c, feature) in features.column_iter().enumerate() {
                    cross[(a, c)] = dot(values, feature.as_slice());
                }
            }
        }
        self.without[piece]
            .0
            .l_dirty()
            .solve_lower_triangular_mut(&mut cross);
        features.tr_mul(features) + cross.tr_mul(&cross)
    }
}
