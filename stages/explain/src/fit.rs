//! All numbers of an explanation fitted at once: Gauss-Newton with Levenberg's damping on the filtered effort.

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, Layer, Scale};

use crate::active::{Active, Column, Efforts, Hypothesis, change, record, subtract};
use crate::columns::{CACHED_ROWS, body_effort, columns};
use crate::drive::is_drive;
use crate::least_squares::Products;
use crate::problem::Problem;

const MAX_ITERATIONS: usize = 12;
/// A step that gains less log-likelihood than this is the last \[nats\].
const CONVERGED: f64 = 1e-3;
/// Step of the difference quotient of a time \[s\].
const TIME_STEP_S: f64 = 0.01;

/// An explanation with its numbers, and what it leaves.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The physics.
    pub actives: Vec<Active>,
    /// What it says of the recordings, unfiltered.
    pub efforts: Efforts,
    /// Measured minus explained, a signal \[N m or N\].
    pub residual: Vec<f64>,
    /// Variance of what is left, by joint; not below the white noise.
    pub variance: Vec<f64>,
    /// Sum of squares of what is left, by joint.
    pub squares: Vec<f64>,
    /// Rows that count, by joint.
    pub count: Vec<f64>,
}

impl Fit {
    /// Evaluates an explanation as it is.
    pub fn new(problem: &Problem, actives: Vec<Active>) -> Self {
        let efforts = Efforts::new(problem, &actives);
        let explained = problem.signal(&efforts.recorded);
        let residual: Vec<f64> = problem
            .measured
            .iter()
            .zip(&explained)
            .map(|(m, e)| m - e)
            .collect();
        let products = Products::new(problem, &[], &residual, None);
        Self {
            actives,
            efforts,
            residual,
            variance: variances(problem, &products.square, &products.count),
            squares: products.square,
            count: products.count,
        }
    }

    /// Log-likelihood of what is left as if it were white, but for a constant: `-n/2 ln(variance)` summed over joints.
    pub fn likelihood(&self) -> f64 {
        likelihood(&self.variance, &self.count)
    }

    /// The joints whose effort a piece of physics changes: one, or all.
    pub fn joints_of(hypothesis: &Hypothesis, joints: usize) -> Vec<usize> {
        hypothesis
            .only_joint()
            .map_or_else(|| (0..joints).collect(), |joint| vec![joint])
    }

    /// Gain of log-likelihood from another fit to this, samples weighted by their `efficiency`.
    pub fn gain_over(&self, other: &Self, efficiency: &[f64]) -> f64 {
        (0..self.variance.len())
            .map(|j| {
                0.5 * efficiency[j] * self.count[j] * (other.variance[j] / self.variance[j]).ln()
            })
            .sum()
    }

    /// The coordinates that are free, as (index of the active, index of the coordinate).
    pub fn parameters(&self) -> Vec<(usize, usize)> {
        let all = self.actives.iter().enumerate();
        all.flat_map(|(i, active)| (0..active.coordinates.len()).map(move |c| (i, c)))
            .collect()
    }

    /// How the explained effort changes with each free coordinate.
    pub fn jacobian(&self, problem: &Problem) -> Vec<Column> {
        self.jacobian_at(problem, None)
    }

    /// How the explained effort changes with each free coordinate of what touches these joints; all without them.
    pub fn jacobian_at(&self, problem: &Problem, joints: Option<&[usize]>) -> Vec<Column> {
        let touching = self.parameters_at(joints).into_iter();
        touching
            .map(|(i, c)| self.sensitivity(problem, i, c))
            .collect()
    }

    /// The coordinates that are free of what touches these joints.
    fn parameters_at(&self, joints: Option<&[usize]>) -> Vec<(usize, usize)> {
        let touches = |&(i, _): &(usize, usize)| {
            let only = self.actives[i].hypothesis.only_joint();
            joints.is_none_or(|joints| only.is_none_or(|only| joints.contains(&only)))
        };
        self.parameters().into_iter().filter(touches).collect()
    }

    fn sensitivity(&self, problem: &Problem, i: usize, c: usize) -> Column {
        let active = &self.actives[i];
        let step = step_of(problem, active, c);
        let mut there = active.clone();
        there.coordinates[c] += step;
        let layer = active.hypothesis.effect.layer;
        let recorded = self
            .actives
            .iter()
            .any(|a| a.hypothesis.effect.layer == Layer::Record);
        let count = active.coordinates.len();
        let linear = active.curve.is_none()
            && !is_drive(&active.hypothesis)
            && active.hypothesis.factors().len() == count;
        if linear && !recorded {
            // What a coordinate adds is the same wherever all are.
            let zero = vec![0.0; count];
            let columns = columns(problem, &[], &self.efforts, active.hypothesis, &zero);
            return columns.factors[c].clone();
        }
        if linear && layer == Layer::Body && problem.rows <= CACHED_ROWS {
            let unit = body_effort(problem, &self.efforts, active.hypothesis, c);
            let mut changed = self.efforts.mechanical.clone();
            for (changed, unit) in changed.iter_mut().zip(unit.iter()) {
                for (k, (value, unit)) in changed.iter_mut().zip(unit).enumerate() {
                    *value += step * self.efforts.gains[k % problem.joints] * unit;
                }
            }
            let recorded = record(problem, &self.actives, &changed);
            let mut values = problem.signal(&subtract(recorded, &self.efforts.recorded));
            for value in &mut values {
                *value /= step;
            }
            return Column {
                joint: None,
                values,
            };
        }
        let (mut column, base) = if layer == Layer::Record {
            let mut all = self.actives.clone();
            all[i] = there;
            let changed = record(problem, &all, &self.efforts.mechanical);
            let values = problem.signal(&changed);
            let base = problem
                .measured
                .iter()
                .zip(&self.residual)
                .map(|(m, r)| m - r)
                .collect();
            (
                Column {
                    joint: None,
                    values,
                },
                base,
            )
        } else {
            let others: &[Active] = if recorded { &self.actives } else { &[] };
            let base = change(problem, others, &self.efforts, active).values;
            (change(problem, others, &self.efforts, &there), base)
        };
        for (value, base) in column.values.iter_mut().zip(&base) {
            *value = (*value - base) / step;
        }
        column
    }

    /// Improves all numbers together.
    #[must_use]
    pub fn refined(self, problem: &Problem) -> Self {
        self.refined_at(problem, None)
    }

    /// Improves the numbers of what touches these joints; all without them.
    #[must_use]
    pub fn refined_at(mut self, problem: &Problem, joints: Option<&[usize]>) -> Self {
        let free = self.parameters_at(joints);
        if free.is_empty() {
            return self;
        }
        let mut damping = 1e-4;
        let mut best = self.likelihood();
        for _ in 0..MAX_ITERATIONS {
            let jacobian: Vec<Column> = free
                .iter()
                .map(|&(i, c)| self.sensitivity(problem, i, c))
                .collect();
            let columns: Vec<&Column> = jacobian.iter().collect();
            let products = Products::new(problem, &columns, &self.residual, None);
            let ridge = vec![0.0; columns.len()];
            let (normal, right) = products.normal(&self.variance, &ridge);
            let mut gained = None;
            for _ in 0..6 {
                let Some(step) = damped(&normal, &right, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let next = Self::new(problem, self.moved(problem, &free, &step));
                let likelihood = next.likelihood();
                if likelihood > best {
                    gained = Some(likelihood - best);
                    best = likelihood;
                    self = next;
                    damping = (damping * 0.2).max(1e-9);
                    break;
                }
                damping *= 8.0;
            }
            if gained.is_none_or(|gained| gained < CONVERGED) {
                break;
            }
        }
        self
    }

    /// The physics with its coordinates moved by `step`, within their bounds.
    fn moved(
        &self,
        problem: &Problem,
        parameters: &[(usize, usize)],
        step: &DVector<f64>,
    ) -> Vec<Active> {
        let mut actives = self.actives.clone();
        for (&(i, c), step) in parameters.iter().zip(step) {
            let (lower, upper) = bounds(problem, &actives[i], c);
            let value = &mut actives[i].coordinates[c];
            *value = (*value + step).clamp(lower, upper);
        }
        actives
    }

    /// The fit with one of its pieces of physics taken out, not refined.
    #[must_use]
    pub fn without(&self, problem: &Problem, index: usize) -> Self {
        let mut actives = self.actives.clone();
        actives.remove(index);
        Self::new(problem, actives)
    }

    /// The fit with one more, not refined.
    #[must_use]
    pub fn with(&self, problem: &Problem, active: Active) -> Self {
        let mut actives = self.actives.clone();
        actives.push(active);
        Self::new(problem, actives)
    }
}

/// `-n/2 ln(variance)`, summed over joints.
pub fn likelihood(variance: &[f64], count: &[f64]) -> f64 {
    variance
        .iter()
        .zip(count)
        .map(|(v, n)| -0.5 * n * v.ln())
        .sum()
}

/// Variances by joint from sums of squares, not below the white noise.
pub fn variances(problem: &Problem, squares: &[f64], count: &[f64]) -> Vec<f64> {
    let all = squares.iter().zip(count).zip(&problem.white_noise);
    all.map(|((s, n), noise)| (s / n.max(1.0)).max(noise * noise).max(1e-16))
        .collect()
}

fn damped(normal: &DMatrix<f64>, right: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
    let p = right.len();
    let scale: Vec<f64> = (0..p).map(|a| normal[(a, a)].max(1e-300).sqrt()).collect();
    let mut scaled = DMatrix::from_fn(p, p, |a, b| normal[(a, b)] / (scale[a] * scale[b]));
    for a in 0..p {
        scaled[(a, a)] += damping + 1e-10;
    }
    let rhs = DVector::from_fn(p, |a, _| right[a] / scale[a]);
    let solved = scaled.cholesky()?.solve(&rhs);
    Some(DVector::from_fn(p, |a, _| solved[a] / scale[a]))
}

/// Step of the difference quotient of a coordinate.
fn step_of(problem: &Problem, active: &Active, c: usize) -> f64 {
    let value = active.coordinates[c];
    match active.kind(c) {
        CoordinateKind::Factor { step, .. } => step,
        CoordinateKind::Shape {
            lower,
            upper,
            scale,
            ..
        } => match scale {
            Scale::Log => 1e-3 * value.abs().max(lower),
            Scale::Linear => 1e-3 * (upper - lower),
            Scale::OfEffort => {
                1e-3 * problem.largest_effort[active.hypothesis.place.joint].max(1e-9)
            }
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => TIME_STEP_S,
    }
}

/// Lowest and highest value of a coordinate.
fn bounds(problem: &Problem, active: &Active, c: usize) -> (f64, f64) {
    match active.kind(c) {
        CoordinateKind::Factor { minimum, .. } => (minimum, f64::INFINITY),
        CoordinateKind::Shape {
            lower,
            upper,
            scale,
            ..
        } => match scale {
            Scale::OfEffort => {
                let largest = problem.largest_effort[active.hypothesis.place.joint];
                (lower * largest, 1.1 * upper * largest)
            }
            Scale::Log | Scale::Linear => (lower, upper),
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => {
            (f64::NEG_INFINITY, f64::INFINITY)
        }
    }
}
