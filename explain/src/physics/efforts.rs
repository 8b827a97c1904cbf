//! Efforts over the recordings, unfiltered, layer by layer: bodies, joints, recording.

use std::sync::Arc;

use tauscope_dynamics::terms::{Layer, MotionSample, Physics, Term};

use crate::data::efforts::{Efforts, TrackEfforts, scale, subtract, zeros};
use crate::data::problem::Problem;
use crate::data::track::FitTrack;
use crate::physics::act::{act_over, run};
use crate::physics::active::Active;
use crate::physics::bodies;
use crate::physics::carrier::{Carrier, carrier, is_on_carrier};
use crate::physics::shaped_bodies::add_shaped;
use crate::physics::torque_scale::gains;

fn terms_of(problem: &Problem, actives: &[Active], layer: Layer) -> Vec<Box<dyn Term>> {
    // A torque scale multiplies the sum of all bodies' efforts, so it is applied to the sum.
    let of_layer = |active: &&Active| {
        active.hypothesis.effect.layer == layer && !active.hypothesis.is_torque_scale()
    };
    let of_layer = actives.iter().filter(of_layer);
    of_layer.map(|active| active.term(&problem.model)).collect()
}

/// Computes the effort that the gears transmit with the effects `actives`.
pub fn transmitted(problem: &Problem, actives: &[Active]) -> TrackEfforts {
    let rigid = &problem.bare().body;
    let mut body = TrackEfforts::clone(rigid);
    let of_bodies =
        |a: &&Active| a.hypothesis.effect.layer == Layer::Body && !a.hypothesis.is_torque_scale();
    let carrier = carrier(&problem.model, actives);
    for active in actives.iter().filter(of_bodies) {
        let alone = carrier.is_none() || !is_on_carrier(active);
        if !(alone && add_shaped(problem, active, &mut body)) {
            bodies::add(problem, active, carrier.as_ref(), rigid, &mut body);
        }
    }
    scale(&mut body, &gains(actives, problem.joints));
    body
}

/// Computes the efforts of all layers with the effects `actives`, whose gears transmit `body`.
pub fn evaluated(problem: &Problem, actives: &[Active], body: Arc<TrackEfforts>) -> Efforts {
    let mechanical = run(problem, terms_of(problem, actives, Layer::Joint), &body);
    let recorded = record(problem, actives, &mechanical);
    Efforts {
        body,
        mechanical: Arc::new(mechanical),
        recorded: Arc::new(recorded),
    }
}

/// Computes the recorded effort from mechanical efforts.
pub fn record(problem: &Problem, actives: &[Active], mechanical: &[Vec<f64>]) -> TrackEfforts {
    run(
        problem,
        terms_of(problem, actives, Layer::Record),
        mechanical,
    )
}

/// Computes the change of the recorded effort when `active` is added to the effects `others`, which result in
/// `efforts`. The effort of bodies is scaled by `gains`; effects that move or tilt them act on `carrier`.
///
/// [`Layer::Record`] terms of `others` act on the change; an `active` of that layer acts after them.
pub fn change(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    active: &Active,
    (gains, carrier): (&[f64], Option<&Carrier>),
) -> TrackEfforts {
    let through = others.iter().any(Active::is_of_record);
    match active.hypothesis.effect.layer {
        Layer::Record => {
            let mut term = active.term(&problem.model);
            let changed = act_over(problem, &mut *term, &efforts.recorded, &efforts.body);
            return subtract(changed, &efforts.recorded);
        }
        Layer::Joint if through => {
            let mut term = active.term(&problem.model);
            let changed = act_over(problem, &mut *term, &efforts.mechanical, &efforts.body);
            return subtract(record(problem, others, &changed), &efforts.recorded);
        }
        Layer::Joint => {
            let mut term = active.term(&problem.model);
            return act_over(problem, &mut *term, &zeros(&efforts.body), &efforts.body);
        }
        Layer::Body => {}
    }
    let mut added = zeros(&efforts.body);
    bodies::add(problem, active, carrier, &efforts.body, &mut added);
    scale(&mut added, gains);
    if !through {
        return added;
    }
    recorded_on_top(problem, others, efforts, &added, 1.0)
}

/// Computes that change for an effect on a joint's effort or on its recording, at the only joint that it changes: one
/// number per sample.
pub fn change_at(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    active: &Active,
    joint: usize,
) -> TrackEfforts {
    let n = problem.joints;
    let of_record = active.hypothesis.effect.layer == Layer::Record;
    let mut term = active.term(&problem.model);
    let through = if of_record {
        Vec::new()
    } else {
        record_terms_at(problem, others, joint)
    };
    let mut through = (!through.is_empty()).then(|| Physics::new(through, n));
    let from = match (of_record, &through) {
        (true, _) => Some(&efforts.recorded),
        (false, Some(_)) => Some(&efforts.mechanical),
        (false, None) => None,
    };
    let mut row = vec![0.0; n];
    let mut of_track = |(i, track): (usize, &FitTrack)| {
        let mut changes = Vec::with_capacity(track.track.len());
        let (recorded, body) = (&efforts.recorded[i], &efforts.body[i]);
        term.reset();
        through.iter_mut().for_each(Physics::reset);
        track.track.each(|k, at| {
            let at_k = k * n..(k + 1) * n;
            match from {
                Some(from) => row.copy_from_slice(&from[i][at_k.clone()]),
                None => row.fill(0.0),
            }
            let transmitted = &body[at_k];
            term.act(&MotionSample { transmitted, ..*at }, &mut row);
            if let Some(through) = &mut through {
                through.act(at, &mut row);
            }
            let before = from.map_or(0.0, |_| recorded[k * n + joint]);
            changes.push(row[joint] - before);
        });
        changes
    };
    problem
        .tracks
        .iter()
        .enumerate()
        .map(&mut of_track)
        .collect()
}

/// Returns the terms of `actives` that transform the recorded effort of a joint.
fn record_terms_at(problem: &Problem, actives: &[Active], joint: usize) -> Vec<Box<dyn Term>> {
    let of_record = actives.iter().filter(|active| active.is_of_record());
    // A coupling uses the recorded effort of another joint.
    let coupled = of_record.clone().any(Active::is_coupling);
    let is_elsewhere = |active: &Active| {
        let own = active.hypothesis.only_joint();
        own.is_some_and(|own| own != joint)
    };
    let of_joint = of_record.filter(|active| coupled || !is_elsewhere(active));
    of_joint.map(|active| active.term(&problem.model)).collect()
}

/// Computes the change of the recorded effort when `share` times `added` is added to the mechanical efforts.
pub fn recorded_on_top(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    added: &[Vec<f64>],
    share: f64,
) -> TrackEfforts {
    let mut changed = TrackEfforts::clone(&efforts.mechanical);
    for (changed, added) in changed.iter_mut().zip(added) {
        for (changed, added) in changed.iter_mut().zip(added) {
            *changed += share * added;
        }
    }
    subtract(record(problem, others, &changed), &efforts.recorded)
}
