//! What a hypothesis could add to an explanation: its best numbers to first order, and what they gain.

use std::borrow::Borrow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, PlaceKind, Scale};

use crate::active::{Active, Column, Hypothesis};
use crate::columns::columns;
use crate::fit::{Fit, likelihood, variances};
use crate::least_squares::Products;
use crate::problem::Problem;

/// Steps of a shape of all joints.
const MOST_STEPS_OF_ALL: usize = 12;

/// How often the step of a grid is halved about its best value.
const HALVINGS: usize = 4;

/// A hypothesis with numbers, and how it compares with leaving it out.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// The physics.
    pub active: Active,
    /// Gain of log-likelihood over the fit it would join, as if what is left were white.
    pub gain: f64,
    /// What that many free numbers gain by chance.
    pub penalty: f64,
    /// Largest share over joints of the variance then left that it explains there.
    pub size: f64,
}

impl Proposal {
    /// Evidence for it, in nats.
    pub fn evidence(&self) -> f64 {
        self.gain - self.penalty
    }
}

/// A fit prepared so that hypotheses can be tried beside all it already holds.
#[derive(Debug)]
pub struct Base<'a> {
    /// The data.
    pub problem: &'a Problem,
    /// What is explained already.
    pub fit: &'a Fit,
    /// How the fit changes with its own numbers.
    jacobian: Vec<Arc<Column>>,
    products: Products,
    /// Keeps shapes from running away in the linear step.
    ridge: Vec<f64>,

    /// Nats that a hypothesis must gain for being one of many.
    pub library: f64,
}

impl<'a> Base<'a> {
    /// Prepares `fit`; `hypotheses` is how many are in the contest.
    pub fn new(problem: &'a Problem, fit: &'a Fit, hypotheses: usize) -> Self {
        let jacobian = fit.jacobian(problem);
        let references: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
        let products = Products::new(problem, &references, &fit.residual, None);
        let ridge = fit
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
                        Scale::Log => 0.5 * active.coordinates[c].abs().max(lower),
                        Scale::Linear => 0.1 * (upper - lower),
                        Scale::OfEffort => 0.1 * active.coordinates[c].abs().max(1e-6),
                    },
                    CoordinateKind::RecordingTime | CoordinateKind::SessionTime => 0.1,
                };
                1.0 / (range * range)
            })
            .collect();
        Self {
            problem,
            fit,
            jacobian,
            products,
            ridge,
            library: (hypotheses.max(1) as f64).ln(),
        }
    }

    /// What `free` numbers at these joints gain by chance.
    pub fn penalty(&self, free: usize, only_joint: Option<usize>) -> f64 {
        let rows: f64 = match only_joint {
            Some(joint) => self.fit.count[joint],
            None => self.fit.count.iter().sum(),
        };
        0.5 * free as f64 * rows.max(2.0).ln() + self.library
    }

    /// Tries `columns` as additional factors, after `alone` is taken off the residual. Gives the factors, the
    /// gain of log-likelihood and the size of it; `minimum` bounds the factors.
    pub fn try_columns<C: Borrow<Column>>(
        &self,
        alone: Option<&Column>,
        columns: &[C],
        minimum: &[f64],
    ) -> Option<(Vec<f64>, f64, f64)> {
        let products = self.augmented(alone, columns);
        let p = self.jacobian.len();
        let q = columns.len();
        let mut ridge = self.ridge.clone();
        ridge.resize(p + q, 0.0);
        let mut used = vec![true; p + q];
        let mut variance = self.fit.variance.clone();
        let mut solution = DVector::zeros(p + q);
        for _ in 0..3 {
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
        // Left over after the last bound was met.
        for a in 0..q {
            if solution[p + a] < minimum[a] {
                return None;
            }
        }
        let squares = products.all_left(&solution);
        let variance = variances(self.problem, &squares, &products.count);
        let gain = likelihood(&variance, &products.count) - self.fit.likelihood();
        let size = (0..squares.len())
            .map(|j| {
                (self.fit.squares[j] - squares[j]) / (products.count[j].max(1.0) * variance[j])
            })
            .fold(0.0, f64::max);
        Some((solution.rows(p, q).iter().copied().collect(), gain, size))
    }

    /// The products of the fit's own columns and more, with the residual less `alone`.
    fn augmented<C: Borrow<Column>>(&self, alone: Option<&Column>, more: &[C]) -> Products {
        let problem = self.problem;
        let (p, q) = (self.jacobian.len(), more.len());
        let mut out = Products {
            gram: Vec::with_capacity(problem.joints),
            right: Vec::with_capacity(problem.joints),
            square: self.products.square.clone(),
            count: self.products.count.clone(),
        };
        let mut less = vec![0.0; problem.rows];
        for j in 0..problem.joints {
            let rows = problem.joint_rows(j);
            let weight = &problem.weight[rows.clone()];
            let mut e = &self.fit.residual[rows];
            let mut gram = DMatrix::zeros(p + q, p + q);
            gram.view_mut((0, 0), (p, p))
                .copy_from(&self.products.gram[j]);
            let mut right = DVector::zeros(p + q);
            right.rows_mut(0, p).copy_from(&self.products.right[j]);
            let dot = |a: &[f64], b: &[f64]| -> f64 {
                a.iter()
                    .zip(b)
                    .zip(weight)
                    .map(|((a, b), w)| w * a * b)
                    .sum()
            };
            if let Some(taken) = alone.and_then(|column| column.of_joint(j, problem.rows)) {
                for ((less, e), taken) in less.iter_mut().zip(e).zip(taken) {
                    *less = e - taken;
                }
                e = &less;
                out.square[j] = dot(e, e);
                for (a, own) in self.jacobian.iter().enumerate() {
                    if let Some(own) = own.of_joint(j, problem.rows) {
                        right[a] = dot(own, e);
                    }
                }
            }
            for (a, new) in more.iter().enumerate() {
                let Some(new) = new.borrow().of_joint(j, problem.rows) else {
                    continue;
                };
                right[p + a] = dot(new, e);
                for (b, own) in self.jacobian.iter().enumerate() {
                    if let Some(own) = own.of_joint(j, problem.rows) {
                        let product = dot(new, own);
                        gram[(p + a, b)] = product;
                        gram[(b, p + a)] = product;
                    }
                }
                for (b, other) in more.iter().enumerate().skip(a) {
                    if let Some(other) = other.borrow().of_joint(j, problem.rows) {
                        let product = dot(new, other);
                        gram[(p + a, p + b)] = product;
                        gram[(p + b, p + a)] = product;
                    }
                }
            }
            out.gram.push(gram);
            out.right.push(right);
        }
        out
    }

    /// The best of a hypothesis over the grid of its shapes; effects in time have their own search.
    pub fn propose(&self, hypothesis: Hypothesis) -> Option<Proposal> {
        let mut best: Option<Proposal> = None;
        for shape in shapes(self.problem, hypothesis) {
            if let Some(proposal) = self.propose_at(hypothesis, &shape)
                && best.as_ref().is_none_or(|best| proposal.gain > best.gain)
            {
                best = Some(proposal);
            }
        }
        best.map(|best| self.sharpened(hypothesis, best))
    }

    /// Halves the grid's step about the best value of a single shape a few times, so that rivals are compared at their
    /// best.
    fn sharpened(&self, hypothesis: Hypothesis, mut best: Proposal) -> Proposal {
        let shapes: Vec<usize> = (0..hypothesis.effect.coordinates.len())
            .filter(|&c| {
                matches!(
                    hypothesis.effect.coordinates[c].kind,
                    CoordinateKind::Shape { .. }
                )
            })
            .collect();
        let ([c], true) = (&shapes[..], best.evidence() > 0.0) else {
            return best;
        };
        let grid: Vec<f64> = shapes_of(self.problem, hypothesis, *c);
        let at = grid
            .iter()
            .position(|x| x.to_bits() == best.active.coordinates[*c].to_bits())
            .unwrap_or(0);
        let (mut below, mut above) = (
            grid[at.saturating_sub(1)],
            grid[(at + 1).min(grid.len() - 1)],
        );
        for _ in 0..HALVINGS {
            let centre = best.active.coordinates[*c];
            let (left, right) = (0.5 * (below + centre), 0.5 * (centre + above));
            let mut moved = false;
            for value in [left, right] {
                let mut shape = vec![0.0; hypothesis.effect.coordinates.len()];
                shape[*c] = value;
                if let Some(proposal) = self.propose_at(hypothesis, &shape)
                    && proposal.gain > best.gain
                {
                    best = proposal;
                    (below, above) = if value < centre {
                        (below, centre)
                    } else {
                        (centre, above)
                    };
                    moved = true;
                    break;
                }
            }
            if !moved {
                (below, above) = (left, right);
            }
        }
        best
    }

    /// The best factors of a hypothesis at one shape.
    pub fn propose_at(&self, hypothesis: Hypothesis, shape: &[f64]) -> Option<Proposal> {
        let columns = columns(self.problem, self.fit, hypothesis, shape);
        self.propose_columns(hypothesis, shape, columns.alone.as_ref(), &columns.factors)
    }

    /// The same with the columns given.
    pub fn propose_columns<C: Borrow<Column>>(
        &self,
        hypothesis: Hypothesis,
        shape: &[f64],
        alone: Option<&Column>,
        columns: &[C],
    ) -> Option<Proposal> {
        let factors = hypothesis.factors();
        let minimum: Vec<f64> = factors
            .iter()
            .map(|&i| match hypothesis.effect.coordinates[i].kind {
                CoordinateKind::Factor { minimum, .. } => minimum,
                _ => f64::NEG_INFINITY,
            })
            .collect();
        let (values, gain, size) = self.try_columns(alone, columns, &minimum)?;
        let mut coordinates = shape.to_vec();
        for (&i, value) in factors.iter().zip(values) {
            coordinates[i] = value;
        }
        let free = hypothesis.effect.coordinates.len();
        Some(Proposal {
            active: hypothesis.with(coordinates),
            gain,
            penalty: self.penalty(free, hypothesis.only_joint()),
            size,
        })
    }
}

/// The values of one shape in the grid of a hypothesis.
fn shapes_of(problem: &Problem, hypothesis: Hypothesis, coordinate: usize) -> Vec<f64> {
    shapes(problem, hypothesis)
        .iter()
        .map(|shape| shape[coordinate])
        .collect()
}

/// The grid of a hypothesis' shapes; factors are 0 in it.
pub fn shapes(problem: &Problem, hypothesis: Hypothesis) -> Vec<Vec<f64>> {
    let mut grid = vec![Vec::new()];
    for coordinate in hypothesis.effect.coordinates {
        let values: Vec<f64> = match coordinate.kind {
            CoordinateKind::Shape {
                lower,
                upper,
                steps,
                scale,
            } => {
                let of = |share: f64| match scale {
                    Scale::Linear => lower + share * (upper - lower),
                    Scale::Log => lower * (upper / lower).powf(share),
                    Scale::OfEffort => {
                        let largest = problem.largest_effort[hypothesis.place.joint];
                        largest * (lower + share * (upper - lower))
                    }
                };
                // What all joints share costs the most and is refined well from afar.
                let all = hypothesis.effect.place == PlaceKind::All;
                let steps = if all {
                    steps.min(MOST_STEPS_OF_ALL)
                } else {
                    steps
                };
                (0..steps)
                    .map(|k| of(k as f64 / (steps - 1).max(1) as f64))
                    .collect()
            }
            _ => vec![0.0],
        };
        let longer = |start: &Vec<f64>| {
            let start = start.clone();
            values
                .iter()
                .map(move |&value| {
                    let mut longer = start.clone();
                    longer.push(value);
                    longer
                })
                .collect::<Vec<_>>()
        };
        grid = grid.iter().flat_map(longer).collect();
    }
    grid
}
