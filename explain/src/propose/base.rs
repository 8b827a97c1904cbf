//! The best parameters of a hypothesis to first order, and the log-likelihood that they gain.

use std::borrow::Borrow;
use std::sync::Arc;

use nalgebra::DVector;
use tauscope_dynamics::terms::{CoordinateKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::{Fit, likelihood, variances};
use crate::fit::least_squares::Products;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::friction::least;
use crate::propose::grid::{best_of, shape_index, shapes};
use crate::propose::trial::{Factored, Trial};

/// How often the grid step is halved around its best value.
/// Resolution: a further halving costs at most two first-order scores; the fit refines the shape afterwards.
const HALVINGS: usize = 4;

/// Rounds of solving for factors: each updates the variances, or drops the factors that are below their minimum.
/// Tuned: by hand, for what it costs in time; not swept.
const ROUNDS: usize = 3;

/// Standard deviation of a shape's prior in the linear step, on a logarithmic range: this share of the value.
/// Tuned: by hand, on no recorded seeds; not swept.
const DEVIATION_LOG: f64 = 0.5;
/// The same on a linear range: this share of the range.
/// Tuned: by hand, on no recorded seeds; not swept.
const DEVIATION_LINEAR: f64 = 0.1;
/// The same for a shape that is an effort: this share of the value.
/// Tuned: by hand, on no recorded seeds; not swept.
const DEVIATION_OF_EFFORT: f64 = 0.1;
/// The same for a time \[s\].
/// Tuned: by hand, on no recorded seeds; not swept.
const DEVIATION_TIME_S: f64 = 0.1;
/// Least value of an effort that a deviation is a share of \[N m\].
/// Resolution: keeps the ridge finite; far below any measured effort.
const LEAST_EFFORT_NM: f64 = 1e-6;

/// Penalty of an effect that the list of names lacks, because it is rarer than those of the list \[nats\].
/// Statistical: odds of 150 to 1, so that a name of the list stands where both fit alike.
const OFF_LIST: f64 = 5.0;

/// A hypothesis with parameters, and its gain over leaving it out.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The hypothesis with its parameters.
    pub active: Active,
    /// Gain of log-likelihood over the fit without it, as if the residual were white.
    pub gain: f64,
    /// Penalty for its free parameters and for the size of the library \[nats\].
    pub penalty: f64,
}

impl Proposal {
    /// Evidence for it \[nats\].
    pub fn evidence(&self) -> f64 {
        self.gain - self.penalty
    }
}

/// A fit, prepared for trying further hypotheses beside its own effects.
#[derive(Debug)]
pub struct Base<'a> {
    /// The data.
    pub problem: &'a Problem,
    /// The fit so far.
    pub fit: &'a Fit,
    /// Derivatives of the fit with respect to its own parameters.
    jacobian: Vec<Arc<Column>>,
    products: Products,
    factored: Factored,
    /// Precision of the shapes' priors, which bounds shapes in the linear step; 0 for factors.
    ridge: Vec<f64>,
    /// Logarithm of the number of hypotheses \[nats\].
    pub library: f64,
}

impl<'a> Base<'a> {
    /// Prepares `fit`; `hypotheses` is the number of hypotheses in the library.
    pub fn new(problem: &'a Problem, fit: &'a Fit, hypotheses: usize) -> Self {
        let jacobian = fit.jacobian(problem);
        let references: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
        let products = Products::new(problem, &references, &fit.residual, None);
        let ridge: Vec<f64> = fit
            .parameters()
            .iter()
            .map(|&(i, c)| {
                let active = &fit.actives[i];
                let range = match active.kind(c) {
                    CoordinateKind::Factor { .. } => return 0.0,
                    CoordinateKind::Shape {
                        lower,
                        upper,
                        scale,
                        ..
                    } => match scale {
                        Scale::Log => DEVIATION_LOG * active.coordinates[c].abs().max(lower),
                        Scale::Linear => DEVIATION_LINEAR * (upper - lower),
                        Scale::OfEffort => {
                            DEVIATION_OF_EFFORT * active.coordinates[c].abs().max(LEAST_EFFORT_NM)
                        }
                    },
                    CoordinateKind::RecordingTime | CoordinateKind::SessionTime => DEVIATION_TIME_S,
                };
                1.0 / (range * range)
            })
            .collect();
        let factored = Factored::new(&products, &fit.variance, &ridge);
        Self {
            problem,
            fit,
            jacobian,
            products,
            factored,
            ridge,
            library: (hypotheses.max(1) as f64).ln(),
        }
    }

    /// Penalty for `free` parameters at these joints \[nats\].
    pub fn penalty(&self, free: usize, only_joint: Option<usize>) -> f64 {
        penalty(self.fit, self.library, free, only_joint)
    }

    fn trial<C: Borrow<Column>>(&self, alone: Option<&Column>, columns: &[C]) -> Trial<'_> {
        let own = (&self.jacobian[..], &self.products);
        Trial::new(self.problem, self.fit, own, alone, columns)
    }

    /// First-order score of a hypothesis with these columns, at the fit's variances: it ranks many candidates quickly.
    pub fn first_order_score<C: Borrow<Column>>(
        &self,
        hypothesis: Hypothesis,
        alone: Option<&Column>,
        columns: &[C],
    ) -> Option<f64> {
        let trial = self.trial(alone, columns);
        trial.gain(
            self.problem,
            &self.factored,
            &minimum(self.problem, hypothesis),
        )
    }

    /// The same with one factor before a row and another from then on, for each of these rows, which ascend.
    pub fn first_order_scores_of_split(
        &self,
        hypothesis: Hypothesis,
        column: &Column,
        firsts: &[usize],
    ) -> Vec<Option<f64>> {
        let own = (&self.jacobian[..], &self.products);
        let minimum = minimum(self.problem, hypothesis);
        let trials = Trial::split(self.problem, self.fit, own, column, firsts).into_iter();
        let gain = |trial: Trial<'_>| trial.gain(self.problem, &self.factored, &minimum);
        trials.map(gain).collect()
    }

    /// First-order score of a hypothesis at one shape.
    pub fn first_order_score_at(&self, hypothesis: Hypothesis, shape: &[f64]) -> Option<f64> {
        let columns = self.fit.columns(self.problem, hypothesis, shape);
        self.first_order_score(hypothesis, columns.alone.as_ref(), &columns.factors)
    }

    /// Solves for the factors of additional `columns`, after `alone` is subtracted from the residual. Returns the
    /// factors and the gain of log-likelihood. No factor is below its `minimum`.
    pub fn try_columns<C: Borrow<Column>>(
        &self,
        alone: Option<&Column>,
        columns: &[C],
        minimum: &[f64],
    ) -> Option<(Vec<f64>, f64)> {
        let products = self.trial(alone, columns).products();
        let p = self.jacobian.len();
        let q = columns.len();
        let mut ridge = self.ridge.clone();
        ridge.resize(p + q, 0.0);
        let mut used = vec![true; p + q];
        let mut variance = self.fit.variance.clone();
        let mut solution = DVector::zeros(p + q);
        for _ in 0..ROUNDS {
            solution = products.solve(&variance, &ridge, &used)?;
            let below = (0..q).filter(|&a| used[p + a] && solution[p + a] < minimum[a]);
            let below: Vec<usize> = below.collect();
            if below.is_empty() {
                let squares = products.all_left(&solution);
                variance = variances(self.problem, &squares, &products.count);
            }
            for a in below {
                used[p + a] = false;
            }
        }
        if q > 0 && !used[p..].contains(&true) && alone.is_none() {
            return None;
        }
        // The last round may have left factors below their minimum.
        for a in 0..q {
            if solution[p + a] < minimum[a] {
                return None;
            }
        }
        let squares = products.all_left(&solution);
        let variance = variances(self.problem, &squares, &products.count);
        let gain = likelihood(&variance, &products.count) - self.fit.likelihood();
        Some((solution.rows(p, q).iter().copied().collect(), gain))
    }

    /// The best proposal of a hypothesis over the grid of its shapes. Effects in time are searched in `windows`.
    pub fn propose(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        let grid = shapes(self.problem, hypothesis);
        let (at, gain) = best_of(
            grid.iter()
                .map(|shape| self.first_order_score_at(hypothesis, shape)),
        )?;
        let penalty = self.penalty(grid[at].len(), hypothesis.only_joint());
        let shape = match shape_index(hypothesis) {
            Some(c) if gain > penalty => self.sharpened(hypothesis, c, &grid, (at, gain)),
            _ => grid[at].clone(),
        };
        self.propose_at(hypothesis, &shape)
    }

    /// Refines the only shape, `c`, around the best grid value by halving the step a few times: so rivals are
    /// compared near their optimum.
    fn sharpened(
        &self,
        hypothesis: Hypothesis,
        c: usize,
        grid: &[Vec<f64>],
        (at, mut gain): (usize, f64),
    ) -> Vec<f64> {
        let mut best = grid[at].clone();
        let mut below = grid[at.saturating_sub(1)][c];
        let mut above = grid[(at + 1).min(grid.len() - 1)][c];
        for _ in 0..HALVINGS {
            let centre = best[c];
            let (left, right) = (0.5 * (below + centre), 0.5 * (centre + above));
            (below, above) = (left, right);
            for (value, around) in [(left, (below, centre)), (right, (centre, above))] {
                let mut shape = best.clone();
                shape[c] = value;
                if let Some(other) = self.first_order_score_at(hypothesis, &shape)
                    && other > gain
                {
                    (best, gain) = (shape, other);
                    (below, above) = around;
                    break;
                }
            }
        }
        best
    }

    /// The proposal of a hypothesis at one shape, with the best factors.
    pub fn propose_at(&self, hypothesis: Hypothesis, shape: &[f64]) -> Option<Proposal> {
        let columns = self.fit.columns(self.problem, hypothesis, shape);
        self.propose_columns(hypothesis, shape, columns.alone.as_ref(), &columns.factors)
    }

    /// The same for given columns.
    pub fn propose_columns<C: Borrow<Column>>(
        &self,
        hypothesis: Hypothesis,
        shape: &[f64],
        alone: Option<&Column>,
        columns: &[C],
    ) -> Option<Proposal> {
        let factors = hypothesis.factors();
        let minimum = minimum(self.problem, hypothesis);
        let (values, gain) = self.try_columns(alone, columns, &minimum)?;
        let mut coordinates = shape.to_vec();
        for (&i, value) in factors.iter().zip(values) {
            coordinates[i] = value;
        }
        let free = hypothesis.effect.coordinates.len();
        let is_off_list = hypothesis.effect.traits.is_off_list;
        let prior = if is_off_list { OFF_LIST } else { 0.0 };
        Some(Proposal {
            active: hypothesis.with(coordinates),
            gain,
            penalty: self.penalty(free, hypothesis.only_joint()) + prior,
        })
    }
}

/// Penalty for `free` parameters \[nats\]: that of the Bayesian information criterion, with the rows of `only_joint` or
/// of all joints, plus `library`, the logarithm of the number of hypotheses.
pub fn penalty(fit: &Fit, library: f64, free: usize, only_joint: Option<usize>) -> f64 {
    let rows: f64 = match only_joint {
        Some(joint) => fit.count[joint],
        None => fit.count.iter().sum(),
    };
    0.5 * free as f64 * rows.max(2.0).ln() + library
}

/// Least values of a hypothesis' factors.
fn minimum(problem: &Problem, hypothesis: Hypothesis) -> Vec<f64> {
    let factors = hypothesis.factors();
    let of = factors
        .iter()
        .map(|&i| match hypothesis.effect.coordinates[i].kind {
            CoordinateKind::Factor { minimum, .. } => least(problem, hypothesis, minimum),
            _ => f64::NEG_INFINITY,
        });
    of.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{at_joint, problem_with};

    #[test]
    fn the_number_of_a_linear_effect_is_found_and_what_is_not_there_gains_nothing() {
        let problem = problem_with(3, |_, qd, effort| effort[0] += 0.8 * qd[0]);
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        let found = base.propose(at_joint("viscous_friction", 0)).unwrap();
        assert!((found.active.coordinates[0] - 0.8).abs() < 0.02);
        assert!(found.evidence() > 100.0);
        let other = base.propose(at_joint("viscous_friction", 1));
        assert!(other.is_none_or(|other| other.evidence() < 0.0));
    }

    #[test]
    fn a_shifted_zero_is_found_with_its_number_and_beats_each_body() {
        let model = crate::fixture::model();
        let mut real = model.clone();
        real.shift_zero(1, 0.03);
        let mut noise = crate::fixture::Noise(9);
        let recordings = [6, 7].map(|seed| {
            crate::fixture::recording(&real, seed, |_, _, effort| {
                for x in effort.iter_mut() {
                    *x += 0.02 * noise.next();
                }
            })
        });
        let problem = crate::fixture::problem(&model, &recordings);
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        let found = base.propose(at_joint("joint_zero_offset", 1)).unwrap();
        let evidence = found.evidence();
        let fit = nothing.with(&problem, found.active).refined(&problem);
        let offset = fit.actives[0].coordinates[0];
        assert!((offset - 0.03).abs() < 1e-3, "{offset}");
        for effect in ["link_com", "link_mass"] {
            let mut body = at_joint(effect, 0);
            body.place.link = model.joints()[1].child_link;
            let other = base.propose(body);
            assert!(
                other.is_none_or(|other| other.evidence() < evidence),
                "{effect}"
            );
        }
    }

    #[test]
    fn friction_is_not_negative() {
        let problem = problem_with(4, |_, qd, effort| effort[0] -= 0.8 * qd[0]);
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        assert!(base.propose(at_joint("viscous_friction", 0)).is_none());
    }

    #[test]
    fn the_shape_of_an_effect_is_searched_over_its_range() {
        let problem = problem_with(5, |q, _, effort| effort[1] += 1.5 * (20.0 * q[1]).sin());
        let nothing = Fit::new(&problem, Vec::new());
        let base = Base::new(&problem, &nothing, 40);
        let found = base.propose(at_joint("torque_ripple", 1)).unwrap();
        let cycles = found.active.parameters()[1];
        assert!((cycles / 20.0 - 1.0).abs() < 0.05, "{cycles} cycles");
    }

    #[test]
    fn more_numbers_rows_and_rivals_cost_more() {
        let problem = problem_with(6, |_, _, _| {});
        let fit = Fit::new(&problem, Vec::new());
        let one = penalty(&fit, 0.0, 1, Some(0));
        assert!((penalty(&fit, 0.0, 2, Some(0)) - 2.0 * one).abs() < 1e-12);
        assert!(penalty(&fit, 0.0, 1, None) > one);
        assert!((penalty(&fit, 3.0, 1, Some(0)) - one - 3.0).abs() < 1e-12);
    }
}
