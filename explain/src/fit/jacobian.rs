//! Derivatives of the effort of an explanation with respect to its parameters.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::sync::Arc;

use tauscope_dynamics::terms::{CoordinateKind, Layer, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::physics::efforts::record;
use crate::physics::parts::is_kept;

/// Step of a nonlinear parameter's difference quotient, relative to its range. It is small because the effort of a
/// wall or a limit has a kink.
/// Resolution: between the truncation error of a long step and the rounding error of a short one.
const SHAPE_STEP: f64 = 1e-5;
/// Step of a time's difference quotient \[s\].
/// Resolution: about one sample.
const TIME_STEP_S: f64 = 0.01;

impl Fit {
    /// Returns the free coordinates as (index of the active, index of the coordinate).
    pub fn parameters(&self) -> Vec<(usize, usize)> {
        let all = self.actives.iter().enumerate();
        all.flat_map(|(i, active)| (0..active.coordinates.len()).map(move |c| (i, c)))
            .collect()
    }

    /// Returns the derivative of the explained effort with respect to each free coordinate.
    pub fn jacobian(&self, problem: &Problem) -> Vec<Arc<Column>> {
        let of = |i: usize| self.sensitivities(problem, i);
        (0..self.actives.len()).flat_map(of).collect()
    }

    /// Whether a coordinate is a linear coefficient.
    pub fn is_factor(&self, index: usize, c: usize) -> bool {
        matches!(self.actives[index].kind(c), CoordinateKind::Factor { .. })
    }

    /// Returns the derivatives of the explained effort with respect to the coordinates of an active.
    fn sensitivities(&self, problem: &Problem, index: usize) -> Vec<Arc<Column>> {
        let active = &self.actives[index];
        let hypothesis = active.hypothesis;
        if hypothesis.is_torque_scale() {
            let joint = hypothesis.place.joint;
            let values = self.parts.bodies(problem, &self.actives, joint);
            let joint = Some(joint);
            return vec![Arc::new(Column { joint, values })];
        }
        // The effort is linear in the coefficients, so their derivatives do not depend on them.
        let alike = is_kept(problem, active) && !active.is_of_record();
        let known = alike.then(|| self.columns(problem, hypothesis, &active.shape()));
        let factors = hypothesis.factors();
        let here = OnceCell::new();
        let one = |c: usize| {
            let at = factors.iter().position(|&factor| factor == c);
            match (&known, at) {
                (Some(known), Some(at)) => Arc::clone(&known.factors[at]),
                _ => Arc::new(self.sensitivity(problem, index, c, &here)),
            }
        };
        (0..active.coordinates.len()).map(one).collect()
    }

    /// Returns the difference quotient of one coordinate. `here` caches the effort of the effect at its parameters
    /// for its other coordinates.
    fn sensitivity(
        &self,
        problem: &Problem,
        index: usize,
        c: usize,
        here: &OnceCell<Column>,
    ) -> Column {
        let active = &self.actives[index];
        let hypothesis = active.hypothesis;
        let step = step_of(problem, active, c);
        let mut there = active.clone();
        there.coordinates[c] += step;
        let (mut values, base, joint): (_, Cow<'_, [f64]>, _);
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
            (values, base, joint) = (column.values, Cow::Borrowed(&here.values[..]), column.joint);
        } else if active.is_of_record() {
            let mut all = self.actives.clone();
            all[index] = there;
            let changed = record(problem, &all, &self.efforts(problem).mechanical);
            joint = (hypothesis.only_joint()).filter(|&joint| !self.parts.feeds(joint));
            values = problem.column(&changed, joint).values;
            let rows = joint.map_or(0..problem.joints * problem.rows, |j| problem.joint_rows(j));
            let explained = problem.measured[rows.clone()]
                .iter()
                .zip(&self.residual[rows]);
            base = Cow::Owned(explained.map(|(m, r)| m - r).collect());
        } else {
            let there = self.added(problem, &there);
            let here = here.get_or_init(|| self.added(problem, active));
            joint = there.joint;
            (values, base) = (there.values, Cow::Borrowed(&here.values[..]));
        }
        for (value, base) in values.iter_mut().zip(base.iter()) {
            *value = (*value - base) / step;
        }
        Column { joint, values }
    }
}

/// Returns the step of a coordinate's difference quotient.
pub(crate) fn step_of(problem: &Problem, active: &Active, c: usize) -> f64 {
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
            Scale::Linear | Scale::Waves => SHAPE_STEP * (upper - lower),
            Scale::OfEffort => {
                SHAPE_STEP * problem.largest_effort[active.hypothesis.place.joint].max(1e-9)
            }
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => TIME_STEP_S,
    }
}
