//! What a hypothesis would add to what is recorded, by factor: computed once for each shape where it only adds.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use tauscope_dynamics::terms::{Coordinate, CoordinateKind, Layer};

use crate::data::problem::Problem;
use crate::fit::fitted::Fit;
use crate::physics::active::{Active, Column, Hypothesis, Whereabouts};
use crate::physics::bodies::{self, TrackEfforts};
use crate::physics::efforts::{Efforts, change, column, recorded_on_top, scale, silent, subtract};
use crate::physics::parts::feeds;

/// The columns of a hypothesis at some shape.
#[derive(Debug)]
pub struct Columns {
    /// What its shape alone does, `None` if nothing.
    pub alone: Option<Column>,
    /// What each of its factors adds per unit.
    pub factors: Vec<Arc<Column>>,
}

/// What was computed before, by hypothesis and shape.
#[derive(Debug, Default)]
pub struct ColumnCache {
    columns: Kept<Columns>,
    bodies: Kept<Bodies>,
}

type Key = (&'static str, Whereabouts, Vec<u64>);

/// Problems with more rows than this do without the cache.
pub const CACHED_ROWS: usize = 12_000;
/// No more numbers than these are kept of each kind: 400 MB.
const KEPT_NUMBERS: usize = 50_000_000;

/// Keeps the newest of what was computed, up to [`KEPT_NUMBERS`].
#[derive(Debug)]
struct Kept<T>(Mutex<KeptInner<T>>);

#[derive(Debug)]
struct KeptInner<T> {
    all: HashMap<Key, Arc<T>>,
    /// From the oldest on, with how many numbers each holds.
    order: VecDeque<(Key, usize)>,
    numbers: usize,
}

impl<T> Default for Kept<T> {
    fn default() -> Self {
        Self(Mutex::new(KeptInner {
            all: HashMap::new(),
            order: VecDeque::new(),
            numbers: 0,
        }))
    }
}

impl<T> Kept<T> {
    /// What is kept under `key`, or else what `compute` gives, with how many numbers it holds.
    fn get_or(&self, key: Key, compute: impl FnOnce() -> (T, usize)) -> Arc<T> {
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().all.get(&key) {
            return Arc::clone(known);
        }
        let (new, numbers) = compute();
        let new = Arc::new(new);
        let mut kept = lock();
        if kept.all.insert(key.clone(), Arc::clone(&new)).is_none() {
            kept.order.push_back((key, numbers));
            kept.numbers += numbers;
        }
        while kept.numbers > KEPT_NUMBERS
            && let Some((oldest, numbers)) = kept.order.pop_front()
        {
            kept.all.remove(&oldest);
            kept.numbers -= numbers;
        }
        new
    }
}

fn key(hypothesis: Hypothesis, shape: &[f64]) -> Key {
    let bits = shape.iter().map(|value| value.to_bits()).collect();
    (hypothesis.effect.name, hypothesis.place, bits)
}

/// The columns of a hypothesis at some shape, beside what a fit holds.
pub fn columns(
    problem: &Problem,
    fit: &Fit,
    hypothesis: Hypothesis,
    shape: &[f64],
) -> Arc<Columns> {
    let gains = &fit.parts.gains;
    let body = hypothesis.effect.layer == Layer::Body;
    if hypothesis.needs_load() && fit.parts.is_plain(&hypothesis) {
        let efforts = Efforts::of_bodies(fit.load(problem), problem.joints);
        return Arc::new(computed(problem, &[], &efforts, hypothesis, shape, gains));
    }
    let plain = fit.parts.is_plain(&hypothesis);
    if !plain && body && !in_time(hypothesis, shape) && problem.rows <= CACHED_ROWS {
        return Arc::new(recorded(problem, fit, hypothesis, shape));
    }
    if !plain {
        let efforts = fit.efforts(problem);
        return Arc::new(computed(
            problem,
            &fit.actives,
            efforts,
            hypothesis,
            shape,
            gains,
        ));
    }
    let units = units(problem, hypothesis, shape);
    if !body || gains.iter().all(|gain| (gain - 1.0).abs() <= 0.0) {
        return units;
    }
    let scale = |column: &Column| {
        let mut column = column.clone();
        for (k, value) in column.values.iter_mut().enumerate() {
            *value *= gains[column.joint.unwrap_or(k / problem.rows)];
        }
        column
    };
    Arc::new(Columns {
        alone: units.alone.as_ref().map(scale),
        factors: units.factors.iter().map(|c| Arc::new(scale(c))).collect(),
    })
}

/// The columns of a hypothesis that depends on the motion alone, where nothing transforms what is recorded: before the
/// drives.
pub fn units(problem: &Problem, hypothesis: Hypothesis, shape: &[f64]) -> Arc<Columns> {
    let ones = vec![1.0; problem.joints];
    let compute = || {
        let bare = problem.bare();
        computed(problem, &[], bare, hypothesis, shape, &ones)
    };
    if problem.rows > CACHED_ROWS {
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

/// The steps of the factors of a hypothesis, by their index among its coordinates.
fn steps(hypothesis: Hypothesis) -> Vec<(usize, f64)> {
    let coordinates = hypothesis.effect.coordinates.iter().enumerate();
    coordinates
        .filter_map(|(i, c)| match c.kind {
            CoordinateKind::Factor { step, .. } => Some((i, step)),
            _ => None,
        })
        .collect()
}

/// Whether a shape has a time in it, of which there are too many to be kept.
fn in_time(hypothesis: Hypothesis, shape: &[f64]) -> bool {
    let mut coordinates = hypothesis.effect.coordinates.iter().zip(shape);
    coordinates.any(|(c, value)| {
        let time = matches!(
            c.kind,
            CoordinateKind::RecordingTime | CoordinateKind::SessionTime
        );
        time && value.is_finite()
    })
}

fn computed(
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
        column(
            problem,
            &change(problem, others, efforts, &active, gains),
            joint,
        )
    };
    let alone = at(&coordinates);
    let mut factors = Vec::with_capacity(steps.len());
    if hypothesis.effect.splits_joint() && others.is_empty() {
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

/// What a hypothesis of bodies costs at some shape, unfiltered and before the drives.
#[derive(Debug)]
struct Bodies {
    /// What its shape alone does, `None` if nothing.
    alone: Option<TrackEfforts>,
    /// What each of its factors costs per unit.
    factors: Vec<TrackEfforts>,
}

fn bodies_of(problem: &Problem, hypothesis: Hypothesis, shape: &[f64]) -> Arc<Bodies> {
    problem.cache.bodies.get_or(key(hypothesis, shape), || {
        let rigid = &problem.bare().body;
        let mut coordinates = shape.to_vec();
        let at = |coordinates: &[f64]| {
            let active = hypothesis.with(coordinates.to_vec());
            let mut added = silent(rigid);
            bodies::add(problem, &active, rigid, &mut added);
            added
        };
        for (i, _) in steps(hypothesis) {
            coordinates[i] = 0.0;
        }
        let alone = at(&coordinates);
        let mut factors = Vec::new();
        if hypothesis.effect.splits_joint() {
            factors.push(bodies::rotor(problem, hypothesis.place.joint));
        }
        for (i, step) in steps(hypothesis).into_iter().skip(factors.len()) {
            coordinates[i] = step;
            let mut unit = subtract(at(&coordinates), &alone);
            coordinates[i] = 0.0;
            unit.iter_mut().flatten().for_each(|value| *value /= step);
            factors.push(unit);
        }
        let silent = alone.iter().flatten().all(|x| *x == 0.0);
        let alone = (!silent).then_some(alone);
        let all = factors.iter().chain(&alone).flatten();
        let count = all.map(Vec::len).sum::<usize>();
        (Bodies { alone, factors }, count)
    })
}

/// Adds what an active of bodies costs, as a sum over its factors, if it has a shape that costs much to evaluate; whether
/// it has.
pub fn add_shaped(problem: &Problem, active: &Active, into: &mut [Vec<f64>]) -> bool {
    let hypothesis = active.hypothesis;
    let is_shape = |c: &Coordinate| matches!(c.kind, CoordinateKind::Shape { .. });
    let shaped = hypothesis.effect.coordinates.iter().any(is_shape);
    if !shaped || in_time(hypothesis, &active.coordinates) || problem.rows > CACHED_ROWS {
        return false;
    }
    let steps = steps(hypothesis);
    let bodies = bodies_of(problem, hypothesis, &active.shape());
    let factors = steps.iter().map(|&(i, _)| active.coordinates[i]);
    let factors = factors.zip(&bodies.factors);
    for (factor, body) in bodies.alone.iter().map(|alone| (1.0, alone)).chain(factors) {
        for (into, body) in into.iter_mut().zip(body) {
            for (into, body) in into.iter_mut().zip(body) {
                *into += factor * body;
            }
        }
    }
    true
}

/// The columns of bodies where some joints' recordings are transformed: there what is recorded of them.
fn recorded(problem: &Problem, fit: &Fit, hypothesis: Hypothesis, shape: &[f64]) -> Columns {
    let efforts = fit.efforts(problem);
    let gains = &fit.parts.gains;
    let plain = units(problem, hypothesis, shape);
    let bodies = bodies_of(problem, hypothesis, shape);
    let of = |body: &TrackEfforts, plain: &Column, step: f64| {
        let mut scaled = body.clone();
        scale(&mut scaled, gains);
        let on_top = recorded_on_top(problem, &fit.actives, efforts, &scaled, step);
        let mut values = plain.values.clone();
        for joint in 0..problem.joints {
            let own = &mut values[problem.joint_rows(joint)];
            if fit.parts.transformed[joint] {
                problem.joint_signal(&on_top, joint, own);
                for value in own {
                    *value /= step;
                }
            } else {
                for value in own {
                    *value *= gains[joint];
                }
            }
        }
        Column {
            joint: None,
            values,
        }
    };
    let steps = steps(hypothesis);
    let factors = bodies.factors.iter().zip(&plain.factors).zip(steps);
    let factors = factors.map(|((body, plain), (_, step))| Arc::new(of(body, plain, step)));
    let alone = bodies.alone.as_ref().zip(plain.alone.as_ref());
    Columns {
        factors: factors.collect(),
        alone: alone.map(|(body, plain)| of(body, plain, 1.0)),
    }
}
