//! The values of all explanations that differ from one by a few effects.
//!
//! The gain of each variant is solved for once. For effects that leave the set, the products are updated by the inverse of
//! their block (Schur complement; Golub and Van Loan, *Matrix Computations*, 2013, section 3.2), so a replacement costs
//! little more than an addition.

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};

use crate::physics::active::Hypothesis;

use super::objective::{Base, Objective, Set};
use super::space::Whitened;

/// Largest factor of a bisection, in prior standard deviations. Resolution: larger ones cannot be missed.
const LARGEST: f64 = 10.0;
/// Halvings of a bisection. Resolution: to a millionth of the largest.
const HALVINGS: usize = 24;

/// A set with what its neighbours are compared by.
pub struct Around<'a> {
    objective: &'a Objective<'a>,
    set: Set,
    base: Base,
    /// Inverse of the set's normal matrix.
    inverse: DMatrix<f64>,
    mean: DVector<f64>,
    /// By variant, the products of its residual columns.
    beside: Vec<OnceLock<Beside>>,
}

/// Residual columns of a variant: its columns less their regression on the columns of a set.
struct Beside {
    /// Regression coefficients of its columns on the set's columns.
    shares: DMatrix<f64>,
    /// Products of the residual columns with each other.
    own: DMatrix<f64>,
    /// Products of the residual columns with the residual of the measurement.
    right: DVector<f64>,
}

impl<'a> Around<'a> {
    /// The neighbourhood of a set; nothing if its normal matrix cannot be factored.
    pub fn new(objective: &'a Objective<'a>, set: &Set) -> Option<Self> {
        let base = objective.base(set)?;
        let (mean, half) = base.bounded.of_free();
        Some(Self {
            objective,
            set: set.clone(),
            inverse: &half * half.transpose(),
            mean,
            base,
            beside: objective.variants.iter().map(|_| OnceLock::new()).collect(),
        })
    }

    fn beside(&self, variant: usize) -> &Beside {
        self.beside[variant].get_or_init(|| {
            let mut own = self.besides(&[variant]);
            own.swap_remove(0)
        })
    }

    /// Residual columns of some variants, solved for together.
    fn besides(&self, variants: &[usize]) -> Vec<Beside> {
        let objective = self.objective;
        let of = |&v: &usize| objective.variants[v].with_offset();
        let columns: Vec<usize> = variants.iter().flat_map(of).collect();
        let rows = |of: &[usize]| of.iter().map(|&i| objective.gram(i)).collect::<Vec<_>>();
        let (own, offsets) = (rows(&self.base.index), rows(&self.base.offsets));
        let cross = DMatrix::from_fn(own.len(), columns.len(), |a, c| own[a][columns[c]]);
        let shares = &self.inverse * &cross;
        let mut first = 0;
        let one = |v: &usize| {
            let m = of(v).len();
            let (cross, shares) = (cross.columns(first, m), shares.columns(first, m));
            let right = DVector::from_fn(m, |c, _| {
                let at = columns[first + c];
                objective.columns[at].right - offsets.iter().map(|row| row[at]).sum::<f64>()
            });
            first += m;
            Beside {
                own: &objective.own[*v] - cross.tr_mul(&shares),
                right: right - cross.tr_mul(&self.mean),
                shares: shares.into_owned(),
            }
        };
        variants.iter().map(one).collect()
    }

    /// Products of the residual columns of further columns: with each other, and with the residual of the measurement.
    pub fn products(&self, columns: &[Whitened]) -> (DMatrix<f64>, DVector<f64>) {
        let objective = self.objective;
        let m = columns.len();
        let product = |a: &Whitened, at: usize| objective.space.product(a, &objective.columns[at]);
        let index = &self.base.index;
        let cross = DMatrix::from_fn(index.len(), m, |a, c| product(&columns[c], index[a]));
        let own = DMatrix::from_fn(m, m, |a, b| {
            objective.space.product(&columns[a], &columns[b])
        });
        let right = DVector::from_fn(m, |c, _| {
            let offsets = self.base.offsets.iter();
            columns[c].right - offsets.map(|&o| product(&columns[c], o)).sum::<f64>()
        });
        let shares = &self.inverse * &cross;
        (
            own - cross.tr_mul(&shares),
            right - cross.tr_mul(&self.mean),
        )
    }

    /// Loss in value when a variant leaves the set \[nats\], equal to its gain next to the other variants. Their inverse
    /// normal matrix follows from the set's by the Schur complement. Nothing where a bound holds the variant.
    pub fn loss(&self, variant: usize) -> Option<f64> {
        let objective = self.objective;
        let own = &objective.variants[variant];
        let index = self.base.index.iter().enumerate();
        let rows: Vec<usize> = index
            .filter(|(_, column)| own.columns().contains(column))
            .map(|(a, _)| a)
            .collect();
        if rows.len() < own.deviations.len() {
            return None;
        }
        let of_rows = self.inverse.select_rows(&rows);
        let block = of_rows.select_columns(&rows).cholesky()?;
        // The inverse for the others times what the whole one gave.
        let less = |whole: DVector<f64>| -> DVector<f64> {
            &whole - of_rows.tr_mul(&block.solve(&whole.select_rows(&rows)))
        };
        // Products of the variant's columns, offset first, with those of the others.
        let columns: Vec<usize> = own.with_offset().collect();
        let with_others = |column: &usize| {
            let gram = objective.gram(*column);
            let all = self.base.index.iter().map(|&other| gram[other]);
            let mut cross = DVector::from_iterator(self.base.index.len(), all);
            for &row in &rows {
                cross[row] = 0.0;
            }
            cross
        };
        let crosses: Vec<DVector<f64>> = columns.iter().map(with_others).collect();
        let solved: Vec<DVector<f64>> = (crosses.iter())
            .map(|cross| less(&self.inverse * cross))
            .collect();
        let products = DMatrix::from_fn(columns.len(), columns.len(), |a, b| {
            objective.gram(columns[a])[columns[b]] - crosses[a].dot(&solved[b])
        });
        // The measurement without the offsets of the others.
        let mut mean = less(self.mean.clone());
        if own.offset.is_some() {
            mean += &solved[0];
        }
        let right = DVector::from_fn(columns.len(), |a, _| {
            let gram = objective.gram(columns[a]);
            let others = self.base.offsets.iter().filter(|o| Some(**o) != own.offset);
            let offsets: f64 = others.map(|&o| gram[o]).sum();
            objective.columns[columns[a]].right - offsets - crosses[a].dot(&mean)
        });
        Some(objective.gain(own, &objective.own[variant], &products, &right))
    }

    /// The smallest first factor with which a variant would join the set, measured as it is: by bisection.
    pub fn smallest(&self, variant: usize) -> Option<f64> {
        let (own, gram) = (
            &self.objective.variants[variant],
            &self.objective.own[variant],
        );
        if own.offset.is_some() || own.deviations.is_empty() {
            return None;
        }
        let products = &self.beside(variant).own;
        let gains = |scaled: f64| {
            let right = products.column(0) * scaled;
            self.objective.gain(own, gram, products, &right) > 0.0
        };
        let (mut low, mut high) = (0.0, LARGEST);
        if !gains(high) {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if gains(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Some(high * own.deviations[0])
    }

    /// Gain in value by each of some variants where the effects `removed` leave the set, over the set without them
    /// \[nats\]; minus infinity where it cannot join.
    pub fn additions(&self, removed: &[usize], variants: &[usize]) -> Vec<(usize, f64)> {
        let objective = self.objective;
        let less: Set = (self.set.iter().copied())
            .filter(|v| !removed.contains(v))
            .collect();
        // Rows of the removed effects in the normal matrix, and their offsets.
        let is_of = |column: &usize| {
            let of = |v: &usize| objective.variants[*v].columns().contains(column);
            removed.iter().any(of)
        };
        let index = self.base.index.iter().enumerate();
        let rows: Vec<usize> = index.filter(|(_, c)| is_of(c)).map(|(a, _)| a).collect();
        let offsets: Vec<usize> = (removed.iter())
            .filter_map(|&v| objective.variants[v].offset)
            .collect();
        let block = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
            self.inverse[(rows[a], rows[b])]
        });
        let Some(block) = block.cholesky() else {
            return variants.iter().map(|&v| (v, f64::NEG_INFINITY)).collect();
        };
        // Products of the set's columns with the removed offsets, which return to the measurement.
        let index = &self.base.index;
        let returned = offsets.iter().fold(DVector::zeros(index.len()), |sum, &o| {
            let row = objective.gram(o);
            sum + DVector::from_iterator(index.len(), index.iter().map(|&i| row[i]))
        });
        let returned_shares = &self.inverse * &returned;
        let mean = DVector::from_iterator(
            rows.len(),
            rows.iter().map(|&a| self.mean[a] + returned_shares[a]),
        );
        let mean = block.solve(&mean);
        let is_new = |v: &usize| self.beside[*v].get().is_none() && objective.fits(&less, *v);
        let new: Vec<usize> = variants.iter().copied().filter(is_new).collect();
        for (v, beside) in new.iter().zip(self.besides(&new)) {
            self.beside[*v].get_or_init(|| beside);
        }
        let one = |&v: &usize| {
            if !objective.fits(&less, v) {
                return (v, f64::NEG_INFINITY);
            }
            let beside = self.beside(v);
            let columns = objective.variants[v].with_offset();
            let shares = beside.shares.select_rows(&rows);
            let own = &beside.own + shares.tr_mul(&block.solve(&shares));
            let mut right = &beside.right + shares.tr_mul(&mean);
            right -= beside.shares.tr_mul(&returned);
            for (c, column) in columns.enumerate() {
                let products = offsets.iter().map(|&o| objective.gram(o)[column]);
                right[c] += products.sum::<f64>();
            }
            let (variant, gram) = (&objective.variants[v], &objective.own[v]);
            (v, objective.gain(variant, gram, &own, &right))
        };
        variants.iter().map(one).collect()
    }
}

/// Smallest factor of each effect that a set lacks, beyond which it would join the set: of the effects that reports list.
pub fn smallest(objective: &Objective<'_>, set: &Set) -> Vec<(Hypothesis, f64)> {
    let Some(around) = Around::new(objective, set) else {
        return Vec::new();
    };
    let is_told = |v: &usize| {
        let hypothesis = objective.variants[*v].hypothesis;
        hypothesis.effect.traits.smallest_told_as.is_some() && objective.fits(set, *v)
    };
    let told = (0..objective.variants.len()).filter(is_told);
    let mut all: Vec<(Hypothesis, f64)> = Vec::new();
    for v in told {
        let hypothesis = objective.variants[v].hypothesis;
        if all.iter().all(|(other, _)| *other != hypothesis) {
            all.extend(around.smallest(v).map(|factor| (hypothesis, factor)));
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, problem_with};
    use crate::inference::margins::AS_LIKELY;
    use crate::inference::nuisance;
    use crate::inference::state::State;
    use crate::inference::{tangents, variants};

    #[test]
    fn each_neighbour_has_the_value_that_it_has_by_itself() {
        let problem = problem_with(3, |_, qd, effort| effort[0] += 1.2 * qd[0]);
        let mut state = State::new(&problem, true);
        let fit = Fit::new(&problem, Vec::new());
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(&problem, &fit, &sizes, true, state.scales);
        // Factors without a sign: those with one have another value next to each set.
        let mut all = ["torque_bias", "torque_gain"]
            .map(|name| [at_joint(name, 0), at_joint(name, 1)])
            .concat();
        let mut tilt = at_joint("base_tilt", 0);
        tilt.place.link = 0;
        all.push(tilt);
        let mut given = tangents::all(&problem, &fit, &all, &state.efforts);
        given.retain(|given| given.variant.curve.is_none());
        // A delay has an effort without any factor.
        let delay = at_joint("torque_delay", 0);
        given.extend(variants::at(
            &problem,
            &fit,
            delay,
            vec![0.02],
            1,
            &state.efforts,
        ));
        let measured = tangents::measured(&problem, &fit);
        state.estimate_noise(&fit, &nuisances, &given, &measured, true);
        let space = state.space(&nuisances);
        let objective = Objective::new(&space, &measured, given);
        let last = objective.variants.len() - 1;
        let set = vec![0, 2, last];
        let around = Around::new(&objective, &set).unwrap();
        for v in [0, 2, last] {
            let less: Set = set.iter().copied().filter(|w| *w != v).collect();
            let own = objective.score(&set) - objective.score(&less);
            let loss = around.loss(v).unwrap();
            assert!((loss - own).abs() < AS_LIKELY, "{v}: {loss}, {own}");
        }
        for removed in [vec![], vec![0], vec![last], vec![2, last]] {
            let less: Set = set
                .iter()
                .copied()
                .filter(|v| !removed.contains(v))
                .collect();
            for (v, gain) in around.additions(&removed, &[1, 3, 4]) {
                let mut more = less.clone();
                more.push(v);
                more.sort_unstable();
                let own = objective.score(&more) - objective.score(&less);
                // First-order values leave out that the sizes of the others change, too: that decides nothing.
                assert!((gain - own).abs() < AS_LIKELY, "{v}: {gain}, {own}");
            }
        }
    }
}
