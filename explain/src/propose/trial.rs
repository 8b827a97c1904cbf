//! Tries columns beside those of a fit. Only products with the new columns are computed, so that many can be tried.

use std::borrow::Borrow;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::{Fit, likelihood, variances};
use crate::fit::least_squares::{Products, weighted_dot};

/// Least diagonal element that a column is scaled by.
/// Resolution: guards a division by zero where a column is zero.
pub const LEAST_DIAGONAL: f64 = 1e-300;
/// Added to the diagonal of the scaled normal equations, which is 1.
/// Resolution: guards the factorisation of dependent columns.
const RIDGE: f64 = 1e-10;

/// Normal equations of a fit's own columns, factored once.
#[derive(Debug)]
pub struct Factored {
    scale: DVector<f64>,
    /// `None` if the columns are not independent.
    factor: Option<Cholesky<f64, Dyn>>,
    right: DVector<f64>,
}

impl Factored {
    /// Factors the equations for these variances by joint, with `ridge` added to the diagonal.
    pub fn new(products: &Products, variance: &[f64], ridge: &[f64]) -> Self {
        let (normal, right) = products.normal(variance, ridge);
        let p = right.len();
        let scale = normal.diagonal().map(|d| d.max(LEAST_DIAGONAL).sqrt());
        let mut scaled = DMatrix::from_fn(p, p, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
        for a in 0..p {
            scaled[(a, a)] += RIDGE;
        }
        Self {
            scale,
            factor: scaled.cholesky(),
            right,
        }
    }

    /// Solution of the equations for each column of a right side.
    fn solve(&self, mut right: DMatrix<f64>) -> Option<DMatrix<f64>> {
        let factor = self.factor.as_ref()?;
        let scale = |right: &mut DMatrix<f64>| {
            for mut column in right.column_iter_mut() {
                column.component_div_assign(&self.scale);
            }
        };
        scale(&mut right);
        factor.solve_mut(&mut right);
        scale(&mut right);
        Some(right)
    }
}

/// New columns: their products with those of a fit and with its residual.
#[derive(Debug, Clone)]
pub struct Trial<'a> {
    fit: &'a Fit,
    own: &'a Products,
    /// By joint: products of the fit's own columns with the new ones.
    cross: Vec<DMatrix<f64>>,
    /// By joint: products of the new columns with each other.
    gram: Vec<DMatrix<f64>>,
    /// By joint: products of the new columns with the residual.
    right: Vec<DVector<f64>>,
    /// By joint, where a column is subtracted from the residual first: products of the fit's own columns with the rest.
    own_right: Vec<Option<DVector<f64>>>,
    /// By joint: square of the residual.
    square: Vec<f64>,
}

impl<'a> Trial<'a> {
    /// A trial of columns beside the `jacobian` of a fit with its products `own`, after `alone` is subtracted from the
    /// residual.
    pub fn new<C: Borrow<Column>, J: AsRef<Column>>(
        problem: &Problem,
        fit: &'a Fit,
        (jacobian, own): (&[J], &'a Products),
        alone: Option<&Column>,
        columns: &[C],
    ) -> Self {
        let (p, q) = (jacobian.len(), columns.len());
        let mut trial = Self {
            fit,
            own,
            cross: Vec::with_capacity(problem.joints),
            gram: Vec::with_capacity(problem.joints),
            right: Vec::with_capacity(problem.joints),
            own_right: vec![None; problem.joints],
            square: own.square.clone(),
        };
        let mut less = vec![0.0; problem.rows];
        for j in 0..problem.joints {
            let rows = problem.joint_rows(j);
            let weight = &problem.weight[rows.clone()];
            let mut e = &fit.residual[rows];
            let mine: Vec<(usize, &[f64])> = (jacobian.iter().enumerate())
                .filter_map(|(a, c)| Some((a, c.as_ref().of_joint(j, problem.rows)?)))
                .collect();
            if let Some(taken) = alone.and_then(|column| column.of_joint(j, problem.rows)) {
                for ((less, e), taken) in less.iter_mut().zip(e).zip(taken) {
                    *less = e - taken;
                }
                e = &less;
                trial.square[j] = weighted_dot(weight, e, e);
                let mut right = DVector::zeros(p);
                for (a, own) in &mine {
                    right[*a] = weighted_dot(weight, own, e);
                }
                trial.own_right[j] = Some(right);
            }
            let (mut cross, mut gram) = (DMatrix::zeros(p, q), DMatrix::zeros(q, q));
            let mut right = DVector::zeros(q);
            let new = |a: usize| columns[a].borrow().of_joint(j, problem.rows);
            for (a, column) in (0..q).filter_map(|a| Some((a, new(a)?))) {
                right[a] = weighted_dot(weight, column, e);
                for (b, own) in &mine {
                    cross[(*b, a)] = weighted_dot(weight, column, own);
                }
                for (b, other) in (a..q).filter_map(|b| Some((b, new(b)?))) {
                    let product = weighted_dot(weight, column, other);
                    gram[(a, b)] = product;
                    gram[(b, a)] = product;
                }
            }
            trial.cross.push(cross);
            trial.gram.push(gram);
            trial.right.push(right);
        }
        trial
    }

    /// A trial of two columns for each of the rows `firsts`, in ascending order: what `column` has before that row, and
    /// what it has from then on. Running sums serve all of them.
    pub fn split<J: AsRef<Column>>(
        problem: &Problem,
        fit: &'a Fit,
        (jacobian, own): (&[J], &'a Products),
        column: &Column,
        firsts: &[usize],
    ) -> Vec<Self> {
        let (p, joints) = (jacobian.len(), problem.joints);
        let blank = Self {
            fit,
            own,
            cross: vec![DMatrix::zeros(p, 2); joints],
            gram: vec![DMatrix::zeros(2, 2); joints],
            right: vec![DVector::zeros(2); joints],
            own_right: vec![None; joints],
            square: own.square.clone(),
        };
        let mut trials = vec![blank; firsts.len()];
        for j in 0..joints {
            let rows = problem.joint_rows(j);
            let (weight, e) = (&problem.weight[rows.clone()], &fit.residual[rows]);
            let Some(column) = column.of_joint(j, problem.rows) else {
                continue;
            };
            let parts = |other: &[f64]| split_dots(weight, column, other, firsts);
            for (trial, [before, after]) in trials.iter_mut().zip(parts(column)) {
                (trial.gram[j][(0, 0)], trial.gram[j][(1, 1)]) = (before, after);
            }
            for (trial, [before, after]) in trials.iter_mut().zip(parts(e)) {
                (trial.right[j][0], trial.right[j][1]) = (before, after);
            }
            for (a, own) in jacobian.iter().enumerate() {
                let Some(own) = own.as_ref().of_joint(j, problem.rows) else {
                    continue;
                };
                for (trial, [before, after]) in trials.iter_mut().zip(parts(own)) {
                    (trial.cross[j][(a, 0)], trial.cross[j][(a, 1)]) = (before, after);
                }
            }
        }
        trials
    }

    /// Products of all columns, the fit's own first.
    pub fn products(&self) -> Products {
        let (p, q) = (self.own.right[0].len(), self.right[0].len());
        let one = |j: usize| {
            let mut gram = DMatrix::zeros(p + q, p + q);
            gram.view_mut((0, 0), (p, p)).copy_from(&self.own.gram[j]);
            gram.view_mut((0, p), (p, q)).copy_from(&self.cross[j]);
            gram.view_mut((p, 0), (q, p))
                .copy_from(&self.cross[j].transpose());
            gram.view_mut((p, p), (q, q)).copy_from(&self.gram[j]);
            gram
        };
        let right = |j: usize| {
            let mut right = DVector::zeros(p + q);
            right.rows_mut(0, p).copy_from(self.own_right(j));
            right.rows_mut(p, q).copy_from(&self.right[j]);
            right
        };
        let joints = self.square.len();
        Products {
            gram: (0..joints).map(one).collect(),
            right: (0..joints).map(right).collect(),
            square: self.square.clone(),
            count: self.own.count.clone(),
        }
    }

    fn own_right(&self, joint: usize) -> &DVector<f64> {
        self.own_right[joint]
            .as_ref()
            .unwrap_or(&self.own.right[joint])
    }

    /// Gain of log-likelihood by the new columns, with factors not below `minimum`. The factors are solved for at the
    /// variances of the fit, which is not the optimum, but shows which of many columns are best.
    pub fn gain(&self, problem: &Problem, own: &Factored, minimum: &[f64]) -> Option<f64> {
        let q = minimum.len();
        let p = own.right.len();
        let (mut cross, mut gram) = (DMatrix::zeros(p, q), DMatrix::zeros(q, q));
        let mut right = DVector::zeros(q);
        let mut own_right = own.right.clone();
        for (j, variance) in self.fit.variance.iter().enumerate() {
            cross += &self.cross[j] / *variance;
            gram += &self.gram[j] / *variance;
            right += &self.right[j] / *variance;
            if let Some(other) = &self.own_right[j] {
                own_right += (other - &self.own.right[j]) / *variance;
            }
        }
        // Schur complement of the fit's own columns.
        let mut sides = cross.clone().insert_columns(q, 1, 0.0);
        sides.set_column(q, &own_right);
        let solved = own.solve(sides)?;
        let (by_new, by_own) = (solved.columns(0, q), solved.column(q));
        let rest = right - cross.tr_mul(&by_own);
        let schur = &gram - cross.tr_mul(&by_new);
        let mut used = vec![true; q];
        let factors = loop {
            let factors = solved_where(&used, &gram, &schur, &rest)?;
            let below = (0..q).filter(|&a| used[a] && factors[a] < minimum[a]);
            let below: Vec<usize> = below.collect();
            if below.is_empty() {
                break factors;
            }
            for a in below {
                used[a] = false;
            }
        };
        if q > 0 && !used.contains(&true) && self.own_right.iter().all(Option::is_none) {
            return None;
        }
        let mine = by_own - by_new * &factors;
        let squares: Vec<f64> = (0..self.square.len())
            .map(|j| {
                let linear = self.own_right(j).dot(&mine) + self.right[j].dot(&factors);
                let of_own = (&self.own.gram[j] * &mine).dot(&mine);
                let of_both = self.cross[j].tr_mul(&mine).dot(&factors);
                let of_new = (&self.gram[j] * &factors).dot(&factors);
                (self.square[j] - 2.0 * linear + of_own + 2.0 * of_both + of_new).max(0.0)
            })
            .collect();
        let variance = variances(problem, &squares, &self.own.count);
        Some(likelihood(&variance, &self.own.count) - self.fit.likelihood())
    }
}

/// The weighted products of two columns before each of the rows `firsts`, in ascending order, and from then on.
fn split_dots(weight: &[f64], a: &[f64], b: &[f64], firsts: &[usize]) -> Vec<[f64; 2]> {
    let between =
        |from: usize, to: usize| weighted_dot(&weight[from..to], &a[from..to], &b[from..to]);
    let (mut before, mut from) = (0.0, 0);
    let mut sums: Vec<f64> = Vec::with_capacity(firsts.len());
    for &first in firsts {
        before += between(from, first);
        from = first;
        sums.push(before);
    }
    let all = before + between(from, weight.len());
    sums.into_iter()
        .map(|before| [before, all - before])
        .collect()
}

/// Factors of the columns in `used`, 0 for the others; `None` if the columns are dependent.
fn solved_where(
    used: &[bool],
    gram: &DMatrix<f64>,
    schur: &DMatrix<f64>,
    right: &DVector<f64>,
) -> Option<DVector<f64>> {
    let index: Vec<usize> = (0..used.len()).filter(|&a| used[a]).collect();
    let scale = |a: usize| gram[(a, a)].max(LEAST_DIAGONAL).sqrt();
    let m = index.len();
    let mut scaled = DMatrix::from_fn(m, m, |a, b| {
        let (a, b) = (index[a], index[b]);
        schur[(a, b)] / (scale(a) * scale(b))
    });
    for a in 0..m {
        scaled[(a, a)] += RIDGE;
    }
    let side = DVector::from_fn(m, |a, _| right[index[a]] / scale(index[a]));
    let solved = scaled.cholesky()?.solve(&side);
    let mut factors = DVector::zeros(used.len());
    for (a, &i) in index.iter().enumerate() {
        factors[i] = solved[a] / scale(i);
    }
    Some(factors)
}
