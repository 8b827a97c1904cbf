//! What a hypothesis would add to an effort, by factor: computed once for each shape.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use tauscope_dynamics::terms::{CoordinateKind, Layer};

use crate::active::{
    Active, Column, Efforts, Hypothesis, Whereabouts, act_over, change_scaled, subtract,
};
use crate::drive::is_drive;
use crate::problem::Problem;

/// The columns of a hypothesis at some shape.
#[derive(Debug)]
pub struct Columns {
    /// What its shape alone does, `None` if nothing.
    pub alone: Option<Column>,
    /// What each of its factors adds per unit.
    pub factors: Vec<Column>,
}

/// Columns that were computed before, by hypothesis and shape. They are those of a grid, so their number is bounded.
#[derive(Debug, Default)]
pub struct ColumnCache {
    columns: Mutex<HashMap<Key, Arc<Columns>>>,
    bodies: Mutex<HashMap<(&'static str, Whereabouts, usize), BodyEffort>>,
}

/// An effort by track, row-major, one number per joint and sample \[N m\].
type BodyEffort = Arc<Vec<Vec<f64>>>;

type Key = (&'static str, Whereabouts, Vec<u64>);

/// Problems with more rows than this do without the cache: memory stays bounded.
pub const CACHED_ROWS: usize = 12_000;

/// The columns of a hypothesis at some shape, beside the physics `others` that made `efforts`.
pub fn columns(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    hypothesis: Hypothesis,
    shape: &[f64],
) -> Arc<Columns> {
    let effect = hypothesis.effect;
    // What a term adds depends on the motion alone, unless it is recorded through something or scales with the load.
    let alike = effect.layer != Layer::Record
        && effect.name != "load_dependent_friction"
        && !is_drive(&hypothesis)
        && others
            .iter()
            .all(|other| other.hypothesis.effect.layer != Layer::Record)
        && problem.rows <= CACHED_ROWS;
    if !alike {
        let gains = &efforts.gains;
        return Arc::new(compute_columns(
            problem, others, efforts, hypothesis, shape, gains,
        ));
    }
    // Kept as in N m: drives scale what bodies cost.
    let scaled = |columns: &Arc<Columns>| {
        if effect.layer != Layer::Body || efforts.gains.iter().all(|gain| (gain - 1.0).abs() <= 0.0)
        {
            return Arc::clone(columns);
        }
        let scale = |column: &Column| {
            let mut column = column.clone();
            for (k, value) in column.values.iter_mut().enumerate() {
                *value *= efforts.gains[column.joint.unwrap_or(k / problem.rows)];
            }
            column
        };
        Arc::new(Columns {
            alone: columns.alone.as_ref().map(scale),
            factors: columns.factors.iter().map(scale).collect(),
        })
    };
    let bits = shape.iter().map(|value| value.to_bits()).collect();
    let key: Key = (effect.name, hypothesis.place, bits);
    let lock = || {
        problem
            .cache
            .columns
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    };
    if let Some(known) = lock().get(&key).map(Arc::clone) {
        return scaled(&known);
    }
    let ones = vec![1.0; problem.joints];
    let new = Arc::new(compute_columns(
        problem, others, efforts, hypothesis, shape, &ones,
    ));
    lock().insert(key, Arc::clone(&new));
    scaled(&new)
}

/// What a factor of a [`Layer::Body`] effect adds to the bodies' effort per unit, before drives and recording.
pub fn body_effort(
    problem: &Problem,
    efforts: &Efforts,
    hypothesis: Hypothesis,
    coordinate: usize,
) -> BodyEffort {
    let key = (hypothesis.effect.name, hypothesis.place, coordinate);
    let lock = || {
        problem
            .cache
            .bodies
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    };
    if let Some(known) = lock().get(&key).map(Arc::clone) {
        return known;
    }
    let step = match hypothesis.effect.coordinates[coordinate].kind {
        CoordinateKind::Factor { step, .. } => step,
        _ => 1.0,
    };
    let mut coordinates = vec![0.0; hypothesis.effect.coordinates.len()];
    let silent: Vec<Vec<f64>> = efforts.body.iter().map(|b| vec![0.0; b.len()]).collect();
    let at = |coordinates: &[f64]| {
        let mut term = hypothesis.with(coordinates.to_vec()).term(problem);
        act_over(problem, &mut *term, &silent, &efforts.body)
    };
    let base = at(&coordinates);
    coordinates[coordinate] = step;
    let mut unit = subtract(at(&coordinates), &base);
    for value in unit.iter_mut().flatten() {
        *value /= step;
    }
    let unit = Arc::new(unit);
    lock().insert(key, Arc::clone(&unit));
    unit
}

fn compute_columns(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    hypothesis: Hypothesis,
    shape: &[f64],
    gains: &[f64],
) -> Columns {
    let factors = hypothesis.factors();
    let mut coordinates = shape.to_vec();
    for &i in &factors {
        coordinates[i] = 0.0;
    }
    let at = |coordinates: &[f64]| {
        let active = hypothesis.with(coordinates.to_vec());
        change_scaled(problem, others, efforts, &active, gains)
    };
    let alone = at(&coordinates);
    let mut each = Vec::with_capacity(factors.len());
    for &i in &factors {
        let CoordinateKind::Factor { step, .. } = hypothesis.effect.coordinates[i].kind else {
            continue;
        };
        coordinates[i] = step;
        let mut column = at(&coordinates);
        coordinates[i] = 0.0;
        for (value, base) in column.values.iter_mut().zip(&alone.values) {
            *value = (*value - base) / step;
        }
        each.push(column);
    }
    let silent = alone.values.iter().all(|x| *x == 0.0);
    Columns {
        alone: (!silent).then_some(alone),
        factors: each,
    }
}
