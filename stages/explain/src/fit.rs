//! All numbers of an explanation fitted at once: Gauss-Newton with Levenberg's damping on the filtered effort.

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector};
use tauscope_dynamics::terms::{CoordinateKind, Layer, PlaceKind, Scale};

use crate::active::{Active, Column, Hypothesis};
use crate::bodies::TrackEfforts;
use crate::columns::columns;
use crate::drive::is_drive;
use crate::efforts::{Efforts, change, column, record, transmitted};
use crate::least_squares::Products;
use crate::parts::{Parts, is_kept};
use crate::problem::Problem;

const MAX_ITERATIONS: usize = 12;
/// A step that gains less log-likelihood than this is the last \[nats\], or less than this share of the distance from
/// another explanation that it is compared with.
const CONVERGED: f64 = 0.02;
const CONVERGED_SHARE: f64 = 0.01;
/// Step of the difference quotient of a time \[s\].
const TIME_STEP_S: f64 = 0.01;

/// An explanation with its numbers, and what it leaves.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The physics.
    pub actives: Vec<Active>,
    /// What each piece adds to the recordings.
    pub parts: Parts,
    /// What it says of the recordings, unfiltered; where it was asked for.
    efforts: OnceLock<Arc<Efforts>>,
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
        Self::beside(problem, actives, None)
    }

    /// The same, where much is as in the fit `before`.
    fn beside(problem: &Problem, actives: Vec<Active>, before: Option<&Self>) -> Self {
        let known = before.map(|before| (&before.actives[..], &before.parts));
        let parts = Parts::new(problem, &actives, known);
        let mut fit = Self {
            actives,
            parts,
            efforts: OnceLock::new(),
            residual: Vec::new(),
            variance: Vec::new(),
            squares: Vec::new(),
            count: Vec::new(),
        };
        let mut residual = problem.measured.clone();
        for joint in 0..problem.joints {
            let explained = if fit.parts.transformed[joint] {
                let mut signal = vec![0.0; problem.rows];
                problem.joint_signal(&fit.efforts(problem).recorded, joint, &mut signal);
                signal
            } else {
                fit.parts.recorded(problem, &fit.actives, joint)
            };
            for (left, explained) in residual[problem.joint_rows(joint)]
                .iter_mut()
                .zip(&explained)
            {
                *left -= explained;
            }
        }
        fit.residual = residual;
        let products = Products::new(problem, &[], &fit.residual, None);
        fit.variance = variances(problem, &products.square, &products.count);
        fit.squares = products.square;
        fit.count = products.count;
        fit
    }

    /// What it says of the recordings, unfiltered.
    pub fn efforts(&self, problem: &Problem) -> &Efforts {
        self.efforts.get_or_init(|| {
            let body = match self.parts.load() {
                Some(load) => Arc::clone(load),
                None => Arc::new(transmitted(problem, &self.actives)),
            };
            Arc::new(Efforts::new(problem, &self.actives, body))
        })
    }

    /// What the gears transmit, unfiltered.
    pub fn load(&self, problem: &Problem) -> Arc<TrackEfforts> {
        match self.parts.load() {
            Some(load) => Arc::clone(load),
            None => Arc::clone(&self.efforts(problem).body),
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

    /// What a piece of physics would add.
    pub fn added(&self, problem: &Problem, active: &Active) -> Column {
        let gains = &self.parts.gains;
        let joint = active.hypothesis.only_joint();
        if self.parts.is_plain(&active.hypothesis) && joint.is_some() {
            let efforts = if active.needs_load() {
                &Efforts::of_bodies(self.load(problem), problem.joints)
            } else {
                problem.bare()
            };
            return column(
                problem,
                &change(problem, &[], efforts, active, gains),
                joint,
            );
        }
        let joint = joint.filter(|_| !self.parts.is_coupled());
        let changed = change(problem, &self.actives, self.efforts(problem), active, gains);
        column(problem, &changed, joint)
    }

    /// How the explained effort changes with each free coordinate.
    pub fn jacobian(&self, problem: &Problem) -> Vec<Arc<Column>> {
        self.jacobian_at(problem, None)
    }

    /// How the explained effort changes with each free coordinate of what touches these joints; all without them.
    pub fn jacobian_at(&self, problem: &Problem, joints: Option<&[usize]>) -> Vec<Arc<Column>> {
        let free = self.parameters_at(joints);
        let of = |i: usize| {
            free.iter()
                .filter(move |(active, _)| *active == i)
                .map(|(_, c)| *c)
        };
        let touching = (0..self.actives.len()).filter(|&i| of(i).next().is_some());
        touching
            .flat_map(|i| self.sensitivities(problem, i, &of(i).collect::<Vec<_>>()))
            .collect()
    }

    fn touches(&self, index: usize, joints: Option<&[usize]>) -> bool {
        let only = self.actives[index].hypothesis.only_joint();
        joints.is_none_or(|joints| only.is_none_or(|only| joints.contains(&only)))
    }

    /// The coordinates that are free of what touches these joints: of what touches all joints but belongs to others, only
    /// the factors. Its shape is dear and hardly moves.
    pub fn parameters_at(&self, joints: Option<&[usize]>) -> Vec<(usize, usize)> {
        let mut all = self.parameters();
        all.retain(|&(i, c)| {
            self.touches(i, joints) && (self.is_factor(i, c) || self.belongs(i, joints))
        });
        all
    }

    /// Whether a coordinate is a factor.
    pub fn is_factor(&self, index: usize, c: usize) -> bool {
        matches!(self.actives[index].kind(c), CoordinateKind::Factor { .. })
    }

    fn belongs(&self, index: usize, joints: Option<&[usize]>) -> bool {
        let hypothesis = self.actives[index].hypothesis;
        let at_joint = matches!(
            hypothesis.effect.place,
            PlaceKind::Joint | PlaceKind::TwoJoints
        );
        joints.is_none_or(|joints| {
            joints.len() == self.variance.len()
                || (at_joint && joints.contains(&hypothesis.place.joint))
        })
    }

    /// How the explained effort changes with some coordinates of an active.
    fn sensitivities(&self, problem: &Problem, index: usize, of: &[usize]) -> Vec<Arc<Column>> {
        let active = &self.actives[index];
        let hypothesis = active.hypothesis;
        if is_drive(&hypothesis) {
            let joint = hypothesis.place.joint;
            let values = self.parts.bodies(problem, &self.actives, joint);
            let joint = Some(joint);
            return vec![Arc::new(Column { joint, values })];
        }
        // What a factor adds is the same wherever all factors are.
        let alike = is_kept(problem, active) && !active.is_of_record();
        let known = alike.then(|| columns(problem, self, hypothesis, &active.shape()));
        let factors = hypothesis.factors();
        let one = |&c: &usize| {
            let at = factors.iter().position(|&factor| factor == c);
            match (&known, at) {
                (Some(known), Some(at)) => Arc::clone(&known.factors[at]),
                _ => Arc::new(self.sensitivity(problem, index, c)),
            }
        };
        of.iter().map(one).collect()
    }

    /// The difference quotient of one coordinate.
    fn sensitivity(&self, problem: &Problem, index: usize, c: usize) -> Column {
        let active = &self.actives[index];
        let hypothesis = active.hypothesis;
        let step = step_of(problem, active, c);
        let mut there = active.clone();
        there.coordinates[c] += step;
        let (mut values, base, joint);
        if let Some(here) = self.parts.of(index)
            && self.parts.is_plain(&hypothesis)
        {
            let mut column = self.parts.part(problem, &there);
            if hypothesis.effect.layer == Layer::Body {
                for (j, gain) in self.parts.gains.iter().enumerate() {
                    column.values[problem.joint_rows(j)]
                        .iter_mut()
                        .zip(&here.values[problem.joint_rows(j)])
                        .for_each(|(there, here)| *there = here + gain * (*there - here));
                }
            }
            (values, base, joint) = (column.values, here.values.clone(), column.joint);
        } else if active.is_of_record() {
            let mut all = self.actives.clone();
            all[index] = there;
            let changed = record(problem, &all, &self.efforts(problem).mechanical);
            joint = hypothesis.only_joint().filter(|_| !self.parts.is_coupled());
            values = column(problem, &changed, joint).values;
            let rows = joint.map_or(0..problem.joints * problem.rows, |j| problem.joint_rows(j));
            let explained = problem.measured[rows.clone()]
                .iter()
                .zip(&self.residual[rows]);
            base = explained.map(|(m, r)| m - r).collect();
        } else {
            let there = self.added(problem, &there);
            joint = there.joint;
            (values, base) = (there.values, self.added(problem, active).values);
        }
        for (value, base) in values.iter_mut().zip(&base) {
            *value = (*value - base) / step;
        }
        Column { joint, values }
    }

    /// Improves all numbers together.
    #[must_use]
    pub fn refined(self, problem: &Problem) -> Self {
        self.refined_at(problem, None, f64::NAN)
    }

    /// Improves the numbers of what touches these joints, all without them; as precisely as is needed to compare it with an
    /// explanation of the likelihood `rival`, or wholly if that is NaN.
    #[must_use]
    pub fn refined_at(mut self, problem: &Problem, joints: Option<&[usize]>, rival: f64) -> Self {
        let free = self.parameters_at(joints);
        if free.is_empty() {
            return self;
        }
        let mut damping = 1e-4;
        let mut best = self.likelihood();
        for _ in 0..MAX_ITERATIONS {
            let jacobian = self.jacobian_at(problem, joints);
            let columns: Vec<&Column> = jacobian.iter().map(AsRef::as_ref).collect();
            let products = Products::new(problem, &columns, &self.residual, None);
            let ridge = vec![0.0; columns.len()];
            let (normal, right) = products.normal(&self.variance, &ridge);
            let mut gained = None;
            for _ in 0..6 {
                let Some(step) = damped(&normal, &right, damping) else {
                    damping *= 10.0;
                    continue;
                };
                let moved = self.moved(problem, &free, &step);
                let next = Self::beside(problem, moved, Some(&self));
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
            let enough = CONVERGED.max(CONVERGED_SHARE * (best - rival).abs());
            if gained.is_none_or(|gained| gained < enough) {
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
        Self::beside(problem, actives, Some(self))
    }

    /// The fit with one more, not refined.
    #[must_use]
    pub fn with(&self, problem: &Problem, active: Active) -> Self {
        let mut actives = self.actives.clone();
        actives.push(active);
        Self::beside(problem, actives, Some(self))
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
