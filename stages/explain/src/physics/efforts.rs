//! What physics does to the recordings, unfiltered: from the bodies to what is recorded.

use std::sync::Arc;

use tauscope_dynamics::terms::{Layer, MotionSample, Physics, Term};

use crate::data::problem::Problem;
use crate::physics::active::{Active, Column};
use crate::physics::bodies::{self, TrackEfforts};
use crate::physics::columns::add_shaped;
use crate::physics::torque_scale::{gains, is_drive};

/// Efforts of all tracks under some physics.
#[derive(Debug, Clone)]
pub struct Efforts {
    /// Rigid body and [`Layer::Body`] terms: what the gears transmit.
    pub body: Arc<TrackEfforts>,
    /// With the [`Layer::Joint`] terms.
    pub mechanical: Arc<TrackEfforts>,
    /// With the [`Layer::Record`] terms: what is recorded.
    pub recorded: Arc<TrackEfforts>,
    /// Scale of each joint's drive.
    pub gains: Vec<f64>,
}

fn terms_of(problem: &Problem, actives: &[Active], layer: Layer) -> Vec<Box<dyn Term>> {
    // The scale of a drive is that of all bodies, and is put to them when they are summed.
    let of_layer =
        |active: &&Active| active.hypothesis.effect.layer == layer && !is_drive(&active.hypothesis);
    let of_layer = actives.iter().filter(of_layer);
    of_layer.map(|active| active.term(problem)).collect()
}

/// What the gears transmit under the physics of `actives`.
pub fn transmitted(problem: &Problem, actives: &[Active]) -> TrackEfforts {
    let rigid = &problem.bare().body;
    let mut body = TrackEfforts::clone(rigid);
    let of_bodies =
        |a: &&Active| a.hypothesis.effect.layer == Layer::Body && !is_drive(&a.hypothesis);
    for active in actives.iter().filter(of_bodies) {
        if !add_shaped(problem, active, &mut body) {
            bodies::add(problem, active, rigid, &mut body);
        }
    }
    scale(&mut body, &gains(actives, problem.joints));
    body
}

impl Efforts {
    /// Under the physics of `actives`, of which the gears transmit `body`.
    pub fn new(problem: &Problem, actives: &[Active], body: Arc<TrackEfforts>) -> Self {
        let mechanical = run(problem, terms_of(problem, actives, Layer::Joint), &body);
        let recorded = record(problem, actives, &mechanical);
        Self {
            body,
            mechanical: Arc::new(mechanical),
            recorded: Arc::new(recorded),
            gains: gains(actives, problem.joints),
        }
    }

    /// Under no physics but bodies, of which the gears transmit `body`.
    pub fn of_bodies(body: Arc<TrackEfforts>, joints: usize) -> Self {
        Self {
            mechanical: Arc::clone(&body),
            recorded: Arc::clone(&body),
            body,
            gains: vec![1.0; joints],
        }
    }
}

/// Efforts with terms of one layer added.
fn run(problem: &Problem, terms: Vec<Box<dyn Term>>, start: &[Vec<f64>]) -> TrackEfforts {
    if terms.is_empty() {
        return start.to_vec();
    }
    let mut physics = Physics::new(terms, problem.joints);
    let tracks = problem.tracks.iter().zip(start);
    tracks
        .map(|(track, start)| track.track.run(&mut physics, start))
        .collect()
}

/// What is recorded of mechanical efforts.
pub fn record(problem: &Problem, actives: &[Active], mechanical: &[Vec<f64>]) -> TrackEfforts {
    run(
        problem,
        terms_of(problem, actives, Layer::Record),
        mechanical,
    )
}

/// What `active` alone changes in what is recorded: added to the physics `others` that made `efforts`, what bodies cost
/// scaled by `gains`.
///
/// [`Layer::Record`] terms of `others` are passed through; one that is itself of that layer acts after them.
pub fn change(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    active: &Active,
    gains: &[f64],
) -> TrackEfforts {
    let through = others.iter().any(Active::is_of_record);
    match active.hypothesis.effect.layer {
        Layer::Record => {
            let mut term = active.term(problem);
            let changed = act_over(problem, &mut *term, &efforts.recorded, &efforts.body);
            return subtract(changed, &efforts.recorded);
        }
        Layer::Joint if through => {
            let mut term = active.term(problem);
            let changed = act_over(problem, &mut *term, &efforts.mechanical, &efforts.body);
            return subtract(record(problem, others, &changed), &efforts.recorded);
        }
        Layer::Joint => {
            let mut term = active.term(problem);
            return act_over(problem, &mut *term, &silent(&efforts.body), &efforts.body);
        }
        Layer::Body => {}
    }
    let mut added = silent(&efforts.body);
    bodies::add(problem, active, &efforts.body, &mut added);
    scale(&mut added, gains);
    if !through {
        return added;
    }
    recorded_on_top(problem, others, efforts, &added, 1.0)
}

/// What is recorded of `share` times something added to the mechanical efforts, less what is recorded without.
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

/// What a term adds to `start` over all tracks, `transmitted` by the gears.
pub fn act_over(
    problem: &Problem,
    term: &mut dyn Term,
    start: &[Vec<f64>],
    transmitted: &[Vec<f64>],
) -> TrackEfforts {
    let n = problem.joints;
    let mut out = start.to_vec();
    for ((track, effort), transmitted) in problem.tracks.iter().zip(&mut out).zip(transmitted) {
        term.reset();
        track.track.each(|k, at| {
            let row = k * n..(k + 1) * n;
            let at = MotionSample {
                transmitted: &transmitted[row.clone()],
                ..*at
            };
            term.act(&at, &mut effort[row]);
        });
    }
    out
}

/// An effort as a signal: of one joint, or of all.
pub fn column(problem: &Problem, effort: &[Vec<f64>], joint: Option<usize>) -> Column {
    let values = match joint {
        Some(joint) => {
            let mut values = vec![0.0; problem.rows];
            problem.joint_signal(effort, joint, &mut values);
            values
        }
        None => problem.signal(effort),
    };
    Column { joint, values }
}

/// No effort, as many numbers as `like` has.
pub fn silent(like: &[Vec<f64>]) -> TrackEfforts {
    like.iter().map(|like| vec![0.0; like.len()]).collect()
}

/// Scales what bodies cost by the drives.
pub fn scale(bodies: &mut [Vec<f64>], gains: &[f64]) {
    if gains.iter().all(|gain| (gain - 1.0).abs() <= 0.0) {
        return;
    }
    for body in bodies {
        for (k, value) in body.iter_mut().enumerate() {
            *value *= gains[k % gains.len()];
        }
    }
}

/// The difference of two efforts.
pub fn subtract(mut from: TrackEfforts, what: &[Vec<f64>]) -> TrackEfforts {
    for (from, what) in from.iter_mut().zip(what) {
        for (a, b) in from.iter_mut().zip(what) {
            *a -= b;
        }
    }
    from
}
