//! A piece of physics that is part of an explanation, and what it does to the recordings.

use tauscope_dynamics::terms::{
    Coordinate, CoordinateKind, Effect, Layer, MotionSample, Physics, PlaceKind, Site, Table, Term,
    table,
};

use tauscope_dynamics::Model;

use crate::drive::{gains, is_drive};
use crate::problem::Problem;

/// Where an effect is: indices into the model's joints and links; what its kind of place does not ask for is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct Whereabouts {
    /// The joint.
    pub joint: usize,
    /// The joint that drives it.
    pub source: usize,
    /// The link.
    pub link: usize,
}

/// Slow, but fast enough for a sign.
const SLOW_RAD_S: f64 = 0.02;

/// An effect at a place, without its numbers.
#[derive(Debug, Clone, Copy)]
pub struct Hypothesis {
    /// What.
    pub effect: &'static Effect,
    /// Where.
    pub place: Whereabouts,
}

impl PartialEq for Hypothesis {
    fn eq(&self, other: &Self) -> bool {
        self.effect.name == other.effect.name && self.place == other.place
    }
}

impl Hypothesis {
    /// With numbers.
    pub fn with(self, coordinates: Vec<f64>) -> Active {
        Active {
            hypothesis: self,
            coordinates,
            curve: None,
        }
    }

    /// The one joint whose effort it changes, if there is only one.
    pub fn only_joint(&self) -> Option<usize> {
        let at_joint = matches!(self.effect.place, PlaceKind::Joint | PlaceKind::TwoJoints);
        (at_joint && (self.effect.layer != Layer::Body || is_drive(self)))
            .then_some(self.place.joint)
    }

    /// Whether its effort jumps where a joint reverses, so that at rest it may be anything in between.
    pub fn is_set_valued(&self, model: &Model) -> bool {
        let Some(joint) = self.only_joint() else {
            return false;
        };
        let Whereabouts { source, link, .. } = self.place;
        let site = Site {
            model,
            joint,
            source,
            link,
        };
        let middle = |c: &Coordinate| match c.kind {
            CoordinateKind::Factor { .. } => 1.0,
            CoordinateKind::Shape { lower, upper, .. } => (lower * upper).abs().sqrt(),
            _ => 0.0,
        };
        let coordinates: Vec<f64> = self.effect.coordinates.iter().map(middle).collect();
        let mut term = (self.effect.build)(&site, &coordinates);
        let n = model.dof();
        let (zero, one) = (vec![0.0; n], vec![1.0; n]);
        let mut at = |velocity: f64| {
            let velocity = vec![velocity; n];
            let mut effort = vec![0.0; n];
            // Long enough for what has a memory to forget.
            let at = MotionSample {
                dt_s: 1e3,
                recording_s: 1.0,
                session_s: 1.0,
                position: &zero,
                velocity: &velocity,
                acceleration: &zero,
                transmitted: &one,
            };
            term.act(&at, &mut effort);
            effort[joint]
        };
        let jump = (at(SLOW_RAD_S) - at(-SLOW_RAD_S)).abs();
        jump > 0.5 * at(1.0).abs().max(1e-12)
    }

    /// Indices of the coordinates that are factors.
    pub fn factors(&self) -> Vec<usize> {
        let is_factor = |c: &Coordinate| matches!(c.kind, CoordinateKind::Factor { .. });
        let coordinates = self.effect.coordinates.iter().enumerate();
        coordinates
            .filter(|(_, c)| is_factor(c))
            .map(|(i, _)| i)
            .collect()
    }
}

/// An effect at a place with its numbers.
#[derive(Debug, Clone)]
pub struct Active {
    /// What and where.
    pub hypothesis: Hypothesis,
    /// In the effect's coordinates; the values at the knots for a curve.
    pub coordinates: Vec<f64>,
    /// What an `unknown` effect is drawn against; its own values are passed over.
    pub curve: Option<Table>,
}

impl Active {
    /// The term for a problem's robot.
    pub fn term(&self, problem: &Problem) -> Box<dyn Term> {
        self.term_for(&problem.model)
    }

    /// The term for a robot.
    pub fn term_for(&self, model: &Model) -> Box<dyn Term> {
        let Whereabouts {
            joint,
            source,
            link,
        } = self.hypothesis.place;
        let site = Site {
            model,
            joint,
            source,
            link,
        };
        let curve = self.curve.as_ref().and_then(|curve| {
            let values = self.coordinates.clone();
            table(
                &site,
                Table {
                    values,
                    ..curve.clone()
                },
            )
            .ok()
        });
        curve.unwrap_or_else(|| (self.hypothesis.effect.build)(&site, &self.coordinates))
    }

    /// Whether its effort jumps where its joint reverses.
    pub fn is_set_valued(&self, model: &Model) -> bool {
        match &self.curve {
            Some(curve) => curve.by_direction,
            None => self.hypothesis.is_set_valued(model),
        }
    }

    /// How a coordinate enters.
    pub fn kind(&self, coordinate: usize) -> CoordinateKind {
        let of_effect = self.hypothesis.effect.coordinates.get(coordinate);
        of_effect.map_or(Coordinate::factor("value_nm").kind, |c| c.kind)
    }

    /// Its parameters, as reports hold them.
    pub fn parameters(&self) -> Vec<f64> {
        (self.hypothesis.effect.to_parameters)(&self.coordinates)
    }
}

/// A signal that is zero but for one joint, or not.
#[derive(Debug, Clone)]
pub struct Column {
    /// The joint that `values` belong to; `None` if they are of all joints.
    pub joint: Option<usize>,
    /// Rows of the joint, or of all joints one after the other.
    pub values: Vec<f64>,
}

impl Column {
    /// The rows of a joint, `None` if they are zero.
    pub fn of_joint(&self, joint: usize, rows: usize) -> Option<&[f64]> {
        match self.joint {
            Some(own) => (own == joint).then_some(&self.values[..]),
            None => Some(&self.values[joint * rows..(joint + 1) * rows]),
        }
    }
}

/// Efforts of all tracks under some physics, unfiltered and row-major, one `Vec` per track.
#[derive(Debug, Clone)]
pub struct Efforts {
    /// Rigid body and [`Layer::Body`] terms: what the gears transmit.
    pub body: Vec<Vec<f64>>,
    /// With the [`Layer::Joint`] terms.
    pub mechanical: Vec<Vec<f64>>,
    /// With the [`Layer::Record`] terms: what is recorded.
    pub recorded: Vec<Vec<f64>>,
    /// Scale of each joint's drive.
    pub gains: Vec<f64>,
}

fn terms_of(problem: &Problem, actives: &[Active], layer: Layer) -> Vec<Box<dyn Term>> {
    let mut of_layer: Vec<&Active> = actives
        .iter()
        .filter(|active| active.hypothesis.effect.layer == layer)
        .collect();
    // The scale of a drive is that of all bodies.
    of_layer.sort_by_key(|active| is_drive(&active.hypothesis));
    of_layer.iter().map(|active| active.term(problem)).collect()
}

impl Efforts {
    /// Under the physics of `actives`.
    pub fn new(problem: &Problem, actives: &[Active]) -> Self {
        let rigid: Vec<Vec<f64>> = problem
            .tracks
            .iter()
            .map(|t| t.track.rigid.clone())
            .collect();
        let body = run(problem, terms_of(problem, actives, Layer::Body), &rigid);
        let mechanical = run(problem, terms_of(problem, actives, Layer::Joint), &body);
        let recorded = record(problem, actives, &mechanical);
        Self {
            body,
            mechanical,
            recorded,
            gains: gains(actives, problem.joints),
        }
    }
}

/// Efforts with terms of one layer added.
fn run(problem: &Problem, terms: Vec<Box<dyn Term>>, start: &[Vec<f64>]) -> Vec<Vec<f64>> {
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
pub fn record(problem: &Problem, actives: &[Active], mechanical: &[Vec<f64>]) -> Vec<Vec<f64>> {
    run(
        problem,
        terms_of(problem, actives, Layer::Record),
        mechanical,
    )
}

/// What `active` alone changes, as a signal: added to the physics that made `efforts`.
///
/// [`Layer::Record`] terms of `others` are passed through; one that is itself of that layer acts after them.
pub fn change(problem: &Problem, others: &[Active], efforts: &Efforts, active: &Active) -> Column {
    change_scaled(problem, others, efforts, active, &efforts.gains)
}

/// The same, what bodies cost scaled by other gains of the drives.
pub fn change_scaled(
    problem: &Problem,
    others: &[Active],
    efforts: &Efforts,
    active: &Active,
    gains: &[f64],
) -> Column {
    let layer = active.hypothesis.effect.layer;
    if is_drive(&active.hypothesis) {
        return scaled_bodies(problem, efforts, active);
    }
    let mut term = active.term(problem);
    let through = layer != Layer::Record
        && others
            .iter()
            .any(|other| other.hypothesis.effect.layer == Layer::Record);
    let changed: Vec<Vec<f64>> = match layer {
        Layer::Record => act_over(problem, &mut *term, &efforts.recorded, &efforts.body),
        _ if through => act_over(problem, &mut *term, &efforts.mechanical, &efforts.body),
        _ => {
            let zero: Vec<Vec<f64>> = efforts.body.iter().map(|b| vec![0.0; b.len()]).collect();
            act_over(problem, &mut *term, &zero, &efforts.body)
        }
    };
    let mut changed = changed;
    if layer == Layer::Body && gains.iter().any(|gain| (gain - 1.0).abs() > 0.0) {
        let start = if through {
            Some(&efforts.mechanical)
        } else {
            None
        };
        scale_added(&mut changed, start, gains);
    }
    let difference: Vec<Vec<f64>> = match layer {
        Layer::Record => subtract(changed, &efforts.recorded),
        _ if through => subtract(record(problem, others, &changed), &efforts.recorded),
        _ => changed,
    };
    let coupled = through
        && others
            .iter()
            .any(|other| other.hypothesis.effect.place == PlaceKind::TwoJoints);
    match active.hypothesis.only_joint() {
        Some(joint) if !coupled => {
            let mut values = vec![0.0; problem.rows];
            problem.joint_signal(&difference, joint, &mut values);
            Column {
                joint: Some(joint),
                values,
            }
        }
        _ => Column {
            joint: None,
            values: problem.signal(&difference),
        },
    }
}

/// What the scale of one drive changes: its joint's share of the bodies' effort.
fn scaled_bodies(problem: &Problem, efforts: &Efforts, active: &Active) -> Column {
    let joint = active.hypothesis.place.joint;
    let share = active.coordinates[0] / efforts.gains[joint];
    let scaled: Vec<Vec<f64>> = efforts
        .body
        .iter()
        .map(|body| body.iter().map(|x| share * x).collect())
        .collect();
    let mut values = vec![0.0; problem.rows];
    problem.joint_signal(&scaled, joint, &mut values);
    Column {
        joint: Some(joint),
        values,
    }
}

/// Scales what was added to `start` (or to nothing) by the drives.
fn scale_added(changed: &mut [Vec<f64>], start: Option<&Vec<Vec<f64>>>, gains: &[f64]) {
    for (r, changed) in changed.iter_mut().enumerate() {
        for (k, value) in changed.iter_mut().enumerate() {
            let before = start.map_or(0.0, |start| start[r][k]);
            *value = before + gains[k % gains.len()] * (*value - before);
        }
    }
}

/// What a term adds to `start` over all tracks, `transmitted` by the gears.
pub fn act_over(
    problem: &Problem,
    term: &mut dyn Term,
    start: &[Vec<f64>],
    transmitted: &[Vec<f64>],
) -> Vec<Vec<f64>> {
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

/// The difference of two efforts.
pub fn subtract(mut from: Vec<Vec<f64>>, what: &[Vec<f64>]) -> Vec<Vec<f64>> {
    for (from, what) in from.iter_mut().zip(what) {
        for (a, b) in from.iter_mut().zip(what) {
            *a -= b;
        }
    }
    from
}
