//! What a hypothesis could add to an explanation: its best numbers to first order, and what they gain.

use std::borrow::Borrow;
use std::sync::Arc;

use nalgebra::DVector;
use tauscope_dynamics::terms::{CoordinateKind, PlaceKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::{Fit, likelihood, variances};
use crate::fit::least_squares::Products;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::friction::least;
use crate::select::trial::{Factored, Trial};

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
    factored: Factored,
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
                        Scale::Log => 0.5 * active.coordinates[c].abs().max(lower),
                        Scale::Linear => 0.1 * (upper - lower),
                        Scale::OfEffort => 0.1 * active.coordinates[c].abs().max(1e-6),
                    },
                    CoordinateKind::RecordingTime | CoordinateKind::SessionTime => 0.1,
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

    /// What `free` numbers at these joints gain by chance.
    pub fn penalty(&self, free: usize, only_joint: Option<usize>) -> f64 {
        penalty(self.fit, self.library, free, only_joint)
    }

    fn trial<C: Borrow<Column>>(&self, alone: Option<&Column>, columns: &[C]) -> Trial<'_> {
        let own = (&self.jacobian[..], &self.products);
        Trial::new(self.problem, self.fit, own, alone, columns)
    }

    /// What a hypothesis with these columns would gain to first order, as the variances are: to tell the best of many.
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

    /// The same at one shape.
    pub fn first_order_score_at(&self, hypothesis: Hypothesis, shape: &[f64]) -> Option<f64> {
        let columns = self.fit.columns(self.problem, hypothesis, shape);
        self.first_order_score(hypothesis, columns.alone.as_ref(), &columns.factors)
    }

    /// Tries `columns` as additional factors, after `alone` is taken off the residual. Gives the factors, the
    /// gain of log-likelihood and the size of it; `minimum` bounds the factors.
    pub fn try_columns<C: Borrow<Column>>(
        &self,
        alone: Option<&Column>,
        columns: &[C],
        minimum: &[f64],
    ) -> Option<(Vec<f64>, f64, f64)> {
        let products = self.trial(alone, columns).products();
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

    /// The best of a hypothesis over the grid of its shapes; effects in time have their own search.
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

    /// Halves the step of a grid of the single shape `c` about its best value a few times, so that rivals are compared at
    /// their best.
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

    /// The best factors of a hypothesis at one shape.
    pub fn propose_at(&self, hypothesis: Hypothesis, shape: &[f64]) -> Option<Proposal> {
        let columns = self.fit.columns(self.problem, hypothesis, shape);
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
        let minimum = minimum(self.problem, hypothesis);
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

/// What `free` numbers at these joints gain by chance, with a prior of `library` nats against any one hypothesis of the library.
pub fn penalty(fit: &Fit, library: f64, free: usize, only_joint: Option<usize>) -> f64 {
    let rows: f64 = match only_joint {
        Some(joint) => fit.count[joint],
        None => fit.count.iter().sum(),
    };
    0.5 * free as f64 * rows.max(2.0).ln() + library
}

/// The least that the factors of a hypothesis may be.
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

/// The only shape of a hypothesis, if there is one.
fn shape_index(hypothesis: Hypothesis) -> Option<usize> {
    let coordinates = hypothesis.effect.coordinates.iter().enumerate();
    let mut shapes = coordinates.filter(|(_, c)| matches!(c.kind, CoordinateKind::Shape { .. }));
    let (first, _) = shapes.next()?;
    shapes.next().is_none().then_some(first)
}

/// Where the largest of some gains is, and the gain.
pub fn best_of(gains: impl Iterator<Item = Option<f64>>) -> Option<(usize, f64)> {
    let known = gains.enumerate().filter_map(|(i, gain)| Some((i, gain?)));
    known.max_by(|(_, a), (_, b)| a.total_cmp(b))
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
