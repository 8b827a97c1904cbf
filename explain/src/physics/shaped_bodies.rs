//! Effects on bodies whose shape takes long to evaluate: the effort per unit of each factor, computed once per shape.

use std::sync::Arc;

use tauscope_dynamics::terms::{Coordinate, CoordinateKind};

use crate::data::efforts::{subtract, zeros};
use crate::data::memo::{BodyEfforts, Key, MOST_ROWS};
use crate::data::problem::Problem;
use crate::physics::active::{Active, Hypothesis, Whereabouts};
use crate::physics::bodies;

/// The memo's key for the columns of a hypothesis at a shape.
pub fn key(hypothesis: Hypothesis, shape: &[f64]) -> Key {
    let bits = shape.iter().map(|value| value.to_bits()).collect();
    let Whereabouts {
        joint,
        source,
        link,
    } = hypothesis.place;
    (hypothesis.effect.name, [joint, source, link], bits)
}

/// The steps of the factors of a hypothesis, by their index among its coordinates.
pub fn steps(hypothesis: Hypothesis) -> Vec<(usize, f64)> {
    let coordinates = hypothesis.effect.coordinates.iter().enumerate();
    coordinates
        .filter_map(|(i, c)| match c.kind {
            CoordinateKind::Factor { step, .. } => Some((i, step)),
            _ => None,
        })
        .collect()
}

/// Whether a shape contains a time. There are too many times to keep their columns.
pub fn in_time(hypothesis: Hypothesis, shape: &[f64]) -> bool {
    let mut coordinates = hypothesis.effect.coordinates.iter().zip(shape);
    coordinates.any(|(c, value)| {
        let time = matches!(
            c.kind,
            CoordinateKind::RecordingTime | CoordinateKind::SessionTime
        );
        time && value.is_finite()
    })
}

/// The effort per unit of each factor of a hypothesis at a shape, unfiltered.
pub fn bodies_of(problem: &Problem, hypothesis: Hypothesis, shape: &[f64]) -> Arc<BodyEfforts> {
    problem.cache.bodies.get_or(key(hypothesis, shape), || {
        let rigid = &problem.bare().body;
        let mut coordinates = shape.to_vec();
        let at = |coordinates: &[f64]| {
            let active = hypothesis.with(coordinates.to_vec());
            let mut added = zeros(rigid);
            bodies::add(problem, &active, None, rigid, &mut added);
            added
        };
        for (i, _) in steps(hypothesis) {
            coordinates[i] = 0.0;
        }
        let alone = at(&coordinates);
        let mut factors = Vec::new();
        if hypothesis.has_rotor() {
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
        (BodyEfforts { alone, factors }, count)
    })
}

/// Adds the effort of an effect on bodies as a sum over its factors, if its shape takes long to evaluate. Returns whether
/// it did.
pub fn add_shaped(problem: &Problem, active: &Active, into: &mut [Vec<f64>]) -> bool {
    let hypothesis = active.hypothesis;
    let is_shape = |c: &Coordinate| matches!(c.kind, CoordinateKind::Shape { .. });
    let shaped = hypothesis.effect.coordinates.iter().any(is_shape);
    if !shaped || in_time(hypothesis, &active.coordinates) || problem.rows > MOST_ROWS {
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
