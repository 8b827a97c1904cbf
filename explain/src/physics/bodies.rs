//! Effort of bodies over the recordings: a linear combination of the efforts of unit inertias and unit gravity, which
//! are computed once.

use std::sync::Arc;

use tauscope_dynamics::Inertia;
use tauscope_dynamics::terms::Term;

use crate::data::efforts::{TrackEfforts, zeros};
use crate::data::memo::{MOST_ROWS, Unit};
use crate::data::problem::Problem;
use crate::physics::act::{act_over, over_tracks, recorded};
use crate::physics::active::Active;
use crate::physics::carrier::{Carrier, is_on_carrier};

/// Adds the effort of an effect on bodies to efforts over all tracks. `rigid` is the twin's effort. `carrier` holds
/// the robots with the bodies and the tilt of the explanation, if there are any.
pub fn add(
    problem: &Problem,
    active: &Active,
    carrier: Option<&Carrier>,
    rigid: &[Vec<f64>],
    into: &mut [Vec<f64>],
) {
    let hypothesis = active.hypothesis;
    let carrier = carrier.filter(|_| is_on_carrier(active));
    let mut term = active.term(carrier.map_or(&problem.model, |carrier| carrier.robot(active)));
    let of_units = (carrier.is_none()).then(|| in_units(problem, &*term));
    if let Some((unit, factors)) = of_units.flatten() {
        add_units(&units(problem, unit), &factors, into);
    } else if carrier.is_none()
        && hypothesis.is_body()
        && !hypothesis.lasts()
        && problem.rows <= MOST_ROWS
    {
        add_for_a_while(problem, &*term, hypothesis.place.link, into);
    } else {
        if problem.rows <= MOST_ROWS && hypothesis.has_rotor() {
            term.expand(problem.expansion(hypothesis.place.joint));
        }
        if problem.rows <= MOST_ROWS && hypothesis.effect.bends() {
            term.know_recorded(match carrier {
                Some(carrier) => carrier.recorded(problem),
                None => problem
                    .recorded
                    .get_or_init(|| recorded(problem, &problem.model)),
            });
        }
        let added = act_over(problem, &mut *term, &zeros(rigid), rigid);
        add_units(&[added], &[1.0], into);
    }
}

/// Returns the effort of 1 kg m² of rotor inertia at a joint: the first linear coefficient of effects that split a
/// joint into rotor and link.
pub fn rotor(problem: &Problem, joint: usize) -> TrackEfforts {
    let mut effort = zeros(&problem.bare().body);
    for (track, effort) in problem.tracks.iter().zip(&mut effort) {
        let of_joint = effort.iter_mut().zip(&track.track.acceleration);
        let of_joint = of_joint.skip(joint).step_by(problem.joints);
        of_joint.for_each(|(effort, acceleration)| *effort = *acceleration);
    }
    effort
}

/// Returns the effort of an effect on bodies as a signal, if it is a linear combination of unit efforts.
pub fn signal(problem: &Problem, active: &Active) -> Option<Vec<f64>> {
    let (unit, factors) = in_units(problem, &*active.term(&problem.model))?;
    let signals = problem.units.signals.get_or(unit, || {
        let units = units(problem, unit);
        units.iter().map(|unit| problem.signal(unit)).collect()
    });
    let mut sum = vec![0.0; problem.joints * problem.rows];
    for (signal, factor) in signals.iter().zip(&factors).filter(|(_, f)| **f != 0.0) {
        for (sum, signal) in sum.iter_mut().zip(signal) {
            *sum += factor * signal;
        }
    }
    Some(sum)
}

/// Returns the units and their coefficients for a term, if its effort is linear in units that may be cached.
fn in_units(problem: &Problem, term: &dyn Term) -> Option<(Unit, Vec<f64>)> {
    if problem.rows > MOST_ROWS {
        return None;
    }
    if let Some((link, inertia)) = term.inertia() {
        return Some((Unit::Inertia(link), inertia.parameters().to_vec()));
    }
    let mut altered = problem.model.clone();
    let is_altered = term.alter(&mut altered);
    let (before, after) = (problem.model.gravity(), altered.gravity());
    let change = after.iter().zip(before);
    let change: Vec<f64> = change.map(|(after, before)| after - before).collect();
    // A change of the robot other than gravity is not a combination of units.
    let is_of_gravity = is_altered && change.iter().any(|change| *change != 0.0);
    is_of_gravity.then_some((Unit::Gravity, change))
}

/// Adds the effort of a temporary inertia that a term adds at a link.
fn add_for_a_while(problem: &Problem, term: &dyn Term, link: usize, into: &mut [Vec<f64>]) {
    let units = units(problem, Unit::Inertia(link));
    for (r, (track, into)) in problem.tracks.iter().zip(into).enumerate() {
        track.track.each(|k, at| {
            let Some((_, inertia)) = term.inertia_at(at) else {
                return;
            };
            let row = k * problem.joints..(k + 1) * problem.joints;
            for (unit, factor) in units.iter().zip(inertia.parameters()) {
                for (into, unit) in into[row.clone()].iter_mut().zip(&unit[r][row.clone()]) {
                    *into += factor * unit;
                }
            }
        });
    }
}

fn add_units(units: &[TrackEfforts], factors: &[f64], into: &mut [Vec<f64>]) {
    for (unit, factor) in units.iter().zip(factors).filter(|(_, f)| **f != 0.0) {
        for (into, unit) in into.iter_mut().zip(unit) {
            for (into, unit) in into.iter_mut().zip(unit) {
                *into += factor * unit;
            }
        }
    }
}

fn units(problem: &Problem, unit: Unit) -> Arc<Vec<TrackEfforts>> {
    let one = |k: usize| match unit {
        Unit::Inertia(link) => {
            let mut parameters = [0.0; 10];
            parameters[k] = 1.0;
            let model = problem
                .model
                .ghost(link, Inertia::from_parameters(parameters));
            over_tracks(problem, &model, true)
        }
        Unit::Gravity => {
            let mut gravity = [0.0; 3];
            gravity[k] = 1.0;
            let mut model = problem.model.clone();
            model.set_gravity(gravity);
            over_tracks(problem, &model, false)
        }
    };
    let count = match unit {
        Unit::Inertia(_) => 10,
        Unit::Gravity => 3,
    };
    problem
        .units
        .efforts
        .get_or(unit, || (0..count).map(one).collect())
}
