//! An explanation with its parameters: the effort that it computes for the recordings, and the residual.

use std::sync::{Arc, OnceLock};

use crate::data::column::{Column, Columns};
use crate::data::efforts::{Efforts, TrackEfforts};
use crate::data::problem::Problem;
use crate::fit::least_squares::weighted_dot;
use crate::parallel;
use crate::physics::active::{Active, Hypothesis};
use crate::physics::columns::columns;
use crate::physics::efforts::change;
use crate::physics::parts::Parts;

/// Lower bound of a variance, so that its inverse and its logarithm are finite \[squared effort\].
/// Physical: 1e-8 N m is far below what any sensor resolves.
pub(crate) const LEAST_VARIANCE: f64 = 1e-16;

/// An explanation with its parameters, and the residual.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The effects with their parameters.
    pub actives: Vec<Active>,
    /// The effort that each effect adds.
    pub parts: Parts,
    /// Measured minus explained, a signal \[N m or N\].
    pub residual: Vec<f64>,
    /// Variance of the residual by joint, not below that of the white noise.
    pub variance: Vec<f64>,
    /// Sum of squares of the residual, by joint.
    pub squares: Vec<f64>,
    /// Number of compared rows, by joint.
    pub count: Vec<f64>,
    /// Effort of each effect, once [`Fit::own_efforts`] was called.
    own: OnceLock<Vec<Column>>,
}

impl Fit {
    /// Evaluates an explanation at its parameters.
    pub fn new(problem: &Problem, actives: Vec<Active>) -> Self {
        Self::beside(problem, actives, None)
    }

    /// Evaluates an explanation at its parameters. Unchanged efforts are taken from the fit `before`.
    pub(crate) fn beside(problem: &Problem, actives: Vec<Active>, before: Option<&Self>) -> Self {
        let known = before.map(|before| (&before.actives[..], &before.parts));
        let parts = Parts::new(problem, &actives, known);
        let mut fit = Self {
            actives,
            parts,
            residual: Vec::new(),
            variance: Vec::new(),
            squares: Vec::new(),
            count: Vec::new(),
            own: OnceLock::new(),
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
        for joint in 0..problem.joints {
            let rows = problem.joint_rows(joint);
            let (weight, left) = (&problem.weight[rows.clone()], &fit.residual[rows]);
            let (square, count) = (weighted_dot(weight, left, left), weight.iter().sum::<f64>());
            let white = problem.white_noise[joint] * problem.white_noise[joint];
            let variance = (square / count.max(1.0)).max(white).max(LEAST_VARIANCE);
            fit.squares.push(square);
            fit.count.push(count);
            fit.variance.push(variance);
        }
        fit
    }

    /// Returns the computed efforts, unfiltered.
    pub fn efforts(&self, problem: &Problem) -> &Efforts {
        self.parts.efforts(problem, &self.actives)
    }

    /// Returns the effort that the gears transmit, unfiltered.
    pub fn load(&self, problem: &Problem) -> Arc<TrackEfforts> {
        self.parts.load(problem, &self.actives)
    }

    /// Returns the columns of a hypothesis at given nonlinear parameters, in addition to the effects of the fit.
    pub fn columns(
        &self,
        problem: &Problem,
        hypothesis: Hypothesis,
        shape: &[f64],
    ) -> Arc<Columns> {
        columns(problem, (&self.actives, &self.parts), hypothesis, shape)
    }

    /// Returns the effort that another effect would add.
    pub fn added(&self, problem: &Problem, active: &Active) -> Column {
        let on = (&self.parts.gains[..], self.parts.carrier.as_deref());
        let joint = active.hypothesis.only_joint();
        if self.parts.is_plain(&active.hypothesis) && joint.is_some() {
            let efforts = if active.needs_load() {
                &Efforts::of_bodies(self.load(problem))
            } else {
                problem.bare()
            };
            return problem.column(&change(problem, &[], efforts, active, on), joint);
        }
        let joint = joint.filter(|&joint| !self.parts.feeds(joint));
        let changed = change(problem, &self.actives, self.efforts(problem), active, on);
        problem.column(&changed, joint)
    }

    /// Returns the effort of each effect: the residual without it minus the residual with it.
    pub fn own_efforts(&self, problem: &Problem) -> &[Column] {
        let all: Vec<usize> = (0..self.actives.len()).collect();
        let of = |&index: &usize| {
            let less = self.without(problem, &[index]);
            let joint = self.actives[index].hypothesis.only_joint();
            let rows = joint.map_or(0..problem.joints * problem.rows, |j| problem.joint_rows(j));
            let pairs = less.residual[rows.clone()].iter().zip(&self.residual[rows]);
            let values = pairs.map(|(less, with)| less - with).collect();
            Column { joint, values }
        };
        self.own.get_or_init(|| parallel::map(&all, of))
    }

    /// Returns the fit without some of its effects, not refined.
    #[must_use]
    pub fn without(&self, problem: &Problem, indices: &[usize]) -> Self {
        let all = self.actives.iter().enumerate();
        let kept = all.filter(|(index, _)| !indices.contains(index));
        let actives = kept.map(|(_, active)| active.clone()).collect();
        Self::beside(problem, actives, Some(self))
    }
}
