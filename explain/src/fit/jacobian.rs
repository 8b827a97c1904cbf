//! How the effort of an explanation changes with each of its numbers.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::sync::Arc;

use tauscope_dynamics::terms::{CoordinateKind, Layer, PlaceKind, Scale};

use crate::data::column::Column;
use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::Active;
use crate::physics::efforts::record;
use crate::physics::parts::is_kept;

/// Step of the difference quotient of a shape, as a share of its range. Small, because a wall or a limit begins at a
/// point.
/// Resolution: between the curvature over a long step and the rounding over a short one.
const SHAPE_STEP: f64 = 1e-5;
/// Step of the difference quotient of a time \[s\].
/// Tuned: by hand, one sample at 100 Hz, on no recorded seeds; not swept.
const TIME_STEP_S: f64 = 0.01;

impl Fit {
    /// The coordinates that are free, as (index of the active, index of the coordinate).
    pub fn parameters(&self) -> Vec<(usize, usize)> {
        let all = self.actives.iter().enumerate();
        all.flat_map(|(i, active)| (0..active.coordinates.len()).map(move |c| (i, c)))
            .collect()
    }

    /// How the explained effort changes with each free coordinate.
    pub fn jacobian(&self, problem: &Problem) -> Vec<Arc<Column>> {
        self.jacobian_at(problem, None)
    }

    /// The same for the effects that act on these joints; for all effects if `joints` is `None`.
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

    /// The free coordinates of the effects that act on these joints. Of an effect that acts on all joints but belongs to
    /// others, only the factors are free: its shape takes long to evaluate and hardly changes.
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
        if hypothesis.is_torque_scale() {
            let joint = hypothesis.place.joint;
            let values = self.parts.bodies(problem, &self.actives, joint);
            let joint = Some(joint);
            return vec![Arc::new(Column { joint, values })];
        }
        // What a factor adds is the same wherever all factors are.
        let alike = is_kept(problem, active) && !active.is_of_record();
        let known = alike.then(|| self.columns(problem, hypothesis, &active.shape()));
        let factors = hypothesis.factors();
        let here = OnceCell::new();
        let one = |&c: &usize| {
            let at = factors.iter().position(|&factor| factor == c);
            match (&known, at) {
                (Some(known), Some(at)) => Arc::clone(&known.factors[at]),
                _ => Arc::new(self.sensitivity(problem, index, c, &here)),
            }
        };
        of.iter().map(one).collect()
    }

    /// The difference quotient of one coordinate. `here` keeps what the effect adds where it is, for its other coordinates.
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

/// Step of the difference quotient of a coordinate.
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
            Scale::Linear => SHAPE_STEP * (upper - lower),
            Scale::OfEffort => {
                SHAPE_STEP * problem.largest_effort[active.hypothesis.place.joint].max(1e-9)
            }
        },
        CoordinateKind::RecordingTime | CoordinateKind::SessionTime => TIME_STEP_S,
    }
}
