//! An explanation with its numbers: what it says of the recordings, what it leaves, and how both change with each number.

use std::sync::{Arc, OnceLock};

use tauscope_dynamics::terms::{CoordinateKind, Layer, PlaceKind, Scale};

use crate::data::problem::Problem;
use crate::fit::least_squares::Products;
use crate::physics::active::{Active, Column, Hypothesis};
use crate::physics::bodies::TrackEfforts;
use crate::physics::columns::columns;
use crate::physics::efforts::{Efforts, change, column, record, transmitted};
use crate::physics::parts::{Parts, is_kept};
use crate::physics::torque_scale::is_drive;

/// Step of the difference quotient of a shape, as a share of its range: small, because a wall or a limit begins at a point.
const SHAPE_STEP: f64 = 1e-5;
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
    pub(crate) fn beside(problem: &Problem, actives: Vec<Active>, before: Option<&Self>) -> Self {
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
        let joint = joint.filter(|&joint| !self.parts.feeds(joint));
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
            joint = (hypothesis.only_joint()).filter(|&joint| !self.parts.feeds(joint));
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
            Scale::Log => SHAPE_STEP * value.abs().max(lower),
            Scale::Linear => SHAPE_STEP * (upper - lower),
            Scale::OfEffort => {
                SHAPE_STEP * problem.largest_effort[active.hypothesis.place.joint].max(1e-9)
            }
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => TIME_STEP_S,
    }
}
