//! Columns that depend on the motion alone: the effort per unit of each factor of a hypothesis, computed once per shape.

use std::sync::Arc;

use tauscope_dynamics::terms::Layer;

use crate::data::column::{Column, Columns};
use crate::data::efforts::Efforts;
use crate::data::memo::MOST_ROWS;
use crate::data::problem::Problem;
use crate::physics::active::{Active, Hypothesis, feeds};
use crate::physics::bodies;
use crate::physics::efforts::{change, change_at};
use crate::physics::shaped_bodies::{key, steps};

/// The columns of a hypothesis that depends on the motion alone, before torque scales and where no effect transforms the
/// recording.
pub fn units(problem: &Problem, hypothesis: Hypothesis, shape: &[f64]) -> Arc<Columns> {
    let ones = vec![1.0; problem.joints];
    let compute = || {
        let bare = problem.bare();
        computed(problem, &[], bare, hypothesis, shape, &ones)
    };
    if problem.rows > MOST_ROWS {
        return Arc::new(compute());
    }
    problem.cache.columns.get_or(key(hypothesis, shape), || {
        let new = compute();
        let numbers = |c: &Column| c.values.len();
        let count = new.factors.iter().map(|c| numbers(c)).sum::<usize>()
            + new.alone.as_ref().map_or(0, numbers);
        (new, count)
    })
}

/// The columns of a hypothesis at a shape, added to the physics `others` that made `efforts`.
pub fn computed(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    hypothesis: Hypothesis,
    shape: &[f64],
    gains: &[f64],
) -> Columns {
    let record = hypothesis.effect.layer == Layer::Record;
    let joint = hypothesis.only_joint();
    let joint = joint.filter(|&joint| record || !feeds(others, joint));
    let steps = steps(hypothesis);
    let mut coordinates = shape.to_vec();
    for &(i, _) in &steps {
        coordinates[i] = 0.0;
    }
    let at = |coordinates: &[f64]| {
        let active = hypothesis.with(coordinates.to_vec());
        if let Some(joint) = joint.filter(|_| hypothesis.effect.layer != Layer::Body) {
            let changes = change_at(problem, others, efforts, &active, joint);
            return problem.column_at(joint, changes);
        }
        let on = (gains, None);
        problem.column(&change(problem, others, efforts, &active, on), joint)
    };
    let alone = at(&coordinates);
    let mut factors = Vec::with_capacity(steps.len());
    if hypothesis.has_rotor() && others.is_empty() {
        let own = hypothesis.place.joint;
        let mut values = vec![0.0; alone.values.len()];
        let rotor = &mut values[problem.joint_rows(own)];
        problem.joint_signal(&bodies::rotor(problem, own), own, rotor);
        for value in rotor {
            *value *= gains[own];
        }
        factors.push(Arc::new(Column { joint, values }));
        return Columns {
            alone: Some(alone),
            factors,
        };
    }
    for (i, step) in steps {
        coordinates[i] = step;
        let mut column = at(&coordinates);
        coordinates[i] = 0.0;
        for (value, base) in column.values.iter_mut().zip(&alone.values) {
            *value = (*value - base) / step;
        }
        factors.push(Arc::new(column));
    }
    let silent = alone.values.iter().all(|x| *x == 0.0);
    Columns {
        alone: (!silent).then_some(alone),
        factors,
    }
}
