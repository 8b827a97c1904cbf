//! The one number that compares explanations: the logarithm of their marginal likelihood and prior.
//!
//! With whitened measurement y, columns X scaled by their prior standard deviations, and nuisances Z, all coefficients are
//! standard normal beforehand and are integrated out in closed form (Rasmussen and Williams, *Gaussian Processes for
//! Machine Learning*, 2006, section 2.7). Products are formed once; comparing explanations needs no recordings.

use std::collections::HashMap;
use std::sync::{Mutex, OnceLock, PoisonError};

use nalgebra::{DMatrix, DVector};

use crate::data::column::Column;
use crate::parallel;

use super::bounded::Bounded;
use super::prior::USUAL_SHARE;
use super::space::{Measured, Space, Whitened};
use super::variants::{Given, Variant};

/// Correlation of two columns from which on one may take the place of the other. Resolution: changes the computing time.
const RELATED: f64 = 0.3;

/// Smallest square of an effort, as a share of the usual one. Resolution: of the rounding of efforts.
const LEAST_SQUARE: f64 = 1e-18;

/// Variants whose columns are projected on the nuisances together. Resolution: changes the computing time and the memory.
const BLOCK: usize = 32;

/// An explanation: indices of variants, ascending.
pub type Set = Vec<usize>;

/// The objective: see the module.
pub struct Objective<'a> {
    pub(super) space: &'a Space,
    pub(super) measured: Measured,
    /// Hypotheses at the shapes that are tried.
    pub variants: Vec<Variant>,
    pub(super) columns: Vec<Whitened>,
    gram: Vec<OnceLock<Vec<f64>>>,
    /// Products within each variant: offset first, if it has one.
    pub(super) own: Vec<DMatrix<f64>>,
    /// Square of each column, nuisances projected out.
    squares: Vec<f64>,
    related: Vec<OnceLock<Vec<usize>>>,
    scores: Mutex<HashMap<Set, f64>>,
}

/// Solved normal equations of a set.
pub(super) struct Base {
    set: Set,
    pub(super) bounded: Bounded,
    /// Columns of the factors that are not held at zero, without offsets.
    pub(super) index: Vec<usize>,
    pub(super) offsets: Vec<usize>,
}

/// The columns of a variant with their scales: its offset first, if it has one.
fn scaled(given: &Given) -> Vec<(&Column, f64)> {
    let offset = given.alone.iter().map(|alone| (alone, 1.0));
    let factors = given.factors.iter().zip(&given.variant.deviations);
    let factors = factors.map(|(factor, deviation)| (&**factor, *deviation));
    offset.chain(factors).collect()
}

impl<'a> Objective<'a> {
    /// The objective for a measurement, a signal, and the columns of variants.
    pub fn new(space: &'a Space, measured: &Column, given: Vec<Given>) -> Self {
        let mut objective = Self {
            measured: space.measured(measured),
            space,
            variants: Vec::new(),
            columns: Vec::new(),
            gram: Vec::new(),
            own: Vec::new(),
            squares: Vec::new(),
            related: Vec::new(),
            scores: Mutex::default(),
        };
        objective.extend(given);
        objective
    }

    /// The columns of a variant, whitened: its offset first, if it has one.
    pub(super) fn whitened(&self, given: &Given) -> Vec<Whitened> {
        self.space.columns(&scaled(given), &self.measured)
    }

    /// Products of some columns with each other.
    pub(super) fn products(&self, columns: &[Whitened]) -> DMatrix<f64> {
        let m = columns.len();
        DMatrix::from_fn(m, m, |a, b| self.space.product(&columns[a], &columns[b]))
    }

    /// Adds variants, behind those that it has.
    pub fn extend(&mut self, given: Vec<Given>) {
        let blocks: Vec<&[Given]> = given.chunks(BLOCK).collect();
        let whitened = parallel::map(&blocks, |block| {
            let all: Vec<(&Column, f64)> = block.iter().flat_map(scaled).collect();
            self.space.columns(&all, &self.measured)
        });
        let mut whitened = whitened.into_iter().flatten();
        for given in given {
            let columns: Vec<Whitened> = whitened.by_ref().take(scaled(&given).len()).collect();
            let mut variant = given.variant;
            let at = self.columns.len();
            variant.offset = given.alone.is_some().then_some(at);
            variant.first = at + usize::from(given.alone.is_some());
            let own = self.products(&columns);
            self.squares.extend(own.diagonal().iter());
            self.own.push(own);
            self.columns.extend(columns);
            self.variants.push(variant);
        }
        self.gram = self.columns.iter().map(|_| OnceLock::new()).collect();
        self.related = self.variants.iter().map(|_| OnceLock::new()).collect();
    }

    /// Products of one column with all.
    pub(super) fn gram(&self, column: usize) -> &[f64] {
        self.gram[column].get_or_init(|| {
            let a = &self.columns[column];
            let of = |b: &Whitened| self.space.product(a, b);
            self.columns.iter().map(of).collect()
        })
    }

    pub(super) fn base(&self, set: &Set) -> Option<Base> {
        let variants = || set.iter().map(|&v| &self.variants[v]);
        let index: Vec<usize> = variants().flat_map(Variant::columns).collect();
        let offsets: Vec<usize> = variants().filter_map(|v| v.offset).collect();
        let p = index.len();
        let mut normal = DMatrix::zeros(p, p);
        let mut right = DVector::zeros(p);
        for (a, &i) in index.iter().enumerate() {
            let row = self.gram(i);
            for (b, &j) in index.iter().enumerate() {
                normal[(a, b)] = row[j];
            }
            normal[(a, a)] += 1.0;
            right[a] = self.columns[i].right - offsets.iter().map(|&o| row[o]).sum::<f64>();
        }
        let positive = self.positive(set);
        let bounded = Bounded::new(&normal, &right, &|i| positive[i])?;
        Some(Base {
            set: set.clone(),
            index: bounded.free.iter().map(|&i| index[i]).collect(),
            bounded,
            offsets,
        })
    }

    /// By factor of a set, whether it cannot be negative.
    fn positive(&self, set: &Set) -> Vec<bool> {
        let of = |&v: &usize| self.variants[v].positive.iter().copied();
        set.iter().flat_map(of).collect()
    }

    /// The value of a set \[nats\], up to a constant that all sets share.
    pub fn score(&self, set: &Set) -> f64 {
        let lock = || self.scores.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(set) {
            return *known;
        }
        let score = self
            .base(set)
            .map_or(f64::NEG_INFINITY, |base| self.of_base(&base));
        lock().insert(set.clone(), score);
        score
    }

    fn of_base(&self, base: &Base) -> f64 {
        let (mean, half) = base.bounded.mean_and_half();
        let positive = self.positive(&base.set);
        let mut score = base.bounded.evidence(&mean, &half, &|i| positive[i]);
        for &o in &base.offsets {
            let row = self.gram(o);
            score +=
                self.columns[o].right - 0.5 * base.offsets.iter().map(|&p| row[p]).sum::<f64>();
        }
        score += base
            .set
            .iter()
            .map(|&v| self.variants[v].log_prior)
            .sum::<f64>();
        let mut at = 0;
        for &v in &base.set {
            let q = self.variants[v].deviations.len();
            let own = half.rows(at, q);
            score += self.log_size(
                &self.variants[v],
                &self.own[v],
                &mean.rows(at, q).into_owned(),
                &(own * own.transpose()),
            );
            at += q;
        }
        score
    }

    /// Posterior means of the factors of a set, variant by variant.
    pub fn factors(&self, set: &Set) -> Vec<Vec<f64>> {
        let Some(base) = self.base(set) else {
            return set
                .iter()
                .map(|&v| vec![0.0; self.variants[v].deviations.len()])
                .collect();
        };
        let (mean, _) = base.bounded.mean_and_half();
        let mut at = 0;
        let of = |&v: &usize| {
            let deviations = &self.variants[v].deviations;
            let scaled = deviations.iter().enumerate();
            let values: Vec<f64> = scaled
                .map(|(k, deviation)| deviation * mean[at + k])
                .collect();
            at += deviations.len();
            values
        };
        set.iter().map(of).collect()
    }

    /// Whether a variant may join a set.
    pub(super) fn fits(&self, set: &Set, variant: usize) -> bool {
        let own = &self.variants[variant];
        let alike = set
            .iter()
            .filter(|&&v| own.excludes(&self.variants[v]))
            .count();
        let most = own.hypothesis.effect.traits.most_at_one_place;
        alike < most && !set.contains(&variant)
    }

    /// The variants whose columns resemble those of a variant: what may take its place.
    pub fn related(&self, variant: usize) -> &[usize] {
        self.related[variant].get_or_init(|| {
            let of = |v: usize| {
                let own = &self.variants[v];
                let offset = usize::from(own.offset.is_some());
                own.first - offset..own.first + own.deviations.len()
            };
            let square = |c: usize| self.squares[c].max(1e-300);
            (0..self.variants.len())
                .filter(|&w| {
                    w != variant
                        && of(variant).any(|a| {
                            let row = self.gram(a);
                            of(w)
                                .any(|b| row[b].powi(2) > RELATED * RELATED * square(a) * square(b))
                        })
                })
                .collect()
        })
    }

    /// Gain in value by adding a variant to a set \[nats\], from the products of its residual columns: `own` with each
    /// other, `right` with the residual of the measurement. The offset comes first, if it has one. `gram` are the products
    /// of the columns themselves.
    pub(super) fn gain(
        &self,
        variant: &Variant,
        gram: &DMatrix<f64>,
        own: &DMatrix<f64>,
        right: &DVector<f64>,
    ) -> f64 {
        let q = variant.deviations.len();
        let offset = right.len() - q;
        let mut right = right.clone();
        let mut gain = variant.log_prior;
        if offset == 1 {
            gain += right[0] - 0.5 * own[(0, 0)];
            right -= own.column(0);
        }
        let mut normal = own.view((offset, offset), (q, q)).into_owned();
        for i in 0..q {
            normal[(i, i)] += 1.0;
        }
        let right = right.rows(offset, q).into_owned();
        let positive = |k: usize| variant.positive[k];
        let Some(bounded) = Bounded::new(&normal, &right, &positive) else {
            return f64::NEG_INFINITY;
        };
        let (mean, half) = bounded.mean_and_half();
        gain += bounded.evidence(&mean, &half, &positive);
        gain + self.log_size(variant, gram, &mean, &(&half * half.transpose()))
    }

    /// Logarithm of the square of a variant's effort, over that which its prior expects: a moment prior, under which an
    /// effect without effort is no effect (Johnson and Rossell, "On the use of non-local prior densities in Bayesian
    /// hypothesis tests", *Journal of the Royal Statistical Society* B 72, 2010). `gram` are the products of its columns,
    /// offset first; `mean` and `covariance` are those of its scaled factors. A shape is expected to have the usual share of the
    /// effort of the joints that feel it.
    fn log_size(
        &self,
        variant: &Variant,
        gram: &DMatrix<f64>,
        mean: &DVector<f64>,
        covariance: &DMatrix<f64>,
    ) -> f64 {
        if variant.is_forced {
            return 0.0;
        }
        let q = mean.len();
        let offset = gram.nrows() - q;
        let of_factors = gram.view((offset, offset), (q, q));
        let mut square =
            mean.dot(&(of_factors * mean)) + of_factors.component_mul(covariance).sum();
        let mut usual = of_factors.trace();
        if offset == 1 {
            let cross = gram.view((1, 0), (q, 1));
            square += gram[(0, 0)] + 2.0 * mean.dot(&cross.column(0));
            let only = variant.hypothesis.only_joint();
            let efforts = self.space.effort_squares.iter().enumerate();
            let felt = efforts.filter(|(joint, _)| only.is_none_or(|only| only == *joint));
            usual += USUAL_SHARE * USUAL_SHARE * felt.map(|(_, square)| square).sum::<f64>();
        }
        (square / usual.max(f64::MIN_POSITIVE))
            .max(LEAST_SQUARE)
            .ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::fitted::Fit;
    use crate::fixture::{at_joint, problem_with};
    use crate::inference::nuisance;
    use crate::inference::state::State;
    use crate::inference::tangents;

    /// The gain by viscous friction that is measured as `share` of its usual size, whatever the noise is.
    fn gain(share: f64) -> f64 {
        let problem = problem_with(3, |_, qd, effort| effort[0] += 1.2 * qd[0]);
        let mut state = State::new(&problem, true);
        let fit = Fit::new(&problem, Vec::new());
        let sizes = state.sizes(&fit);
        let nuisances = nuisance::of(&problem, &fit, &sizes, true, state.scales);
        let friction = [at_joint("viscous_friction", 0)];
        let mut given = tangents::all(&problem, &fit, &friction, &state.efforts);
        given.truncate(1);
        let measured = tangents::measured(&problem, &fit);
        state.estimate_noise(&fit, &nuisances, &given, &measured, true);
        let space = state.space(&nuisances);
        let objective = Objective::new(&space, &measured, given);
        let (own, gram) = (DMatrix::from_element(1, 1, 1e6), &objective.own[0]);
        let right = DVector::from_element(1, 1e6 * share);
        objective.gain(&objective.variants[0], gram, &own, &right) - 0.5 * 1e6 * share * share
    }

    /// Beside the likelihood, the logarithm of the square of the size decides.
    #[test]
    fn an_effect_of_a_hundredth_of_its_usual_size_is_ten_thousand_times_less_likely_beforehand() {
        // The normal factor of the prior takes half a nat of the usual size.
        let less = gain(1.0) + 0.5 - gain(1e-2);
        assert!((less - 2.0 * 100_f64.ln()).abs() < 0.1, "{less}");
        // An effect of no size is as unlikely as one that the noise allows.
        assert!(gain(0.0) < gain(1e-2) - 2.0);
    }
}
