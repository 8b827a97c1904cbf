//! An explanation's effort as a sum of parts, one per effect, each filtered once. Most effects only add to the recorded
//! effort, so a change of one leaves the parts of the others as they are. A joint with an effect that transforms its
//! recording is evaluated as a whole.

use std::sync::{Arc, OnceLock};

use tauscope_dynamics::terms::{Coordinate, CoordinateKind, Layer, PlaceKind};

use crate::data::column::Column;
use crate::data::efforts::{Efforts, TrackEfforts};
use crate::data::memo::MOST_ROWS;
use crate::data::problem::Problem;
use crate::physics::active::{Active, Hypothesis, feeds};
use crate::physics::bodies;
use crate::physics::carrier::{Carrier, alters_robot, carrier, is_on_carrier};
use crate::physics::efforts::{change, evaluated, transmitted};
use crate::physics::torque_scale::gains;
use crate::physics::unit_columns::units;

/// The effort that each effect of an explanation adds.
#[derive(Debug, Clone)]
pub struct Parts {
    /// Torque scale of each joint.
    pub gains: Vec<f64>,
    /// Joints whose recording an effect transforms, so that it is not a sum of parts.
    pub transformed: Vec<bool>,
    /// The robots that effects act on, where they are not that of the URDF.
    pub carrier: Option<Arc<Carrier>>,
    /// By effect, the effort that it adds before torque scales; `None` if it does not only add.
    columns: Vec<Option<Arc<Column>>>,
    /// The effort that the gears transmit, if a part depends on it.
    load: Option<Arc<TrackEfforts>>,
    /// Joints whose effort a coupling adds to another joint's recording.
    feeds: Vec<bool>,
    /// The efforts of all layers, unfiltered, once they were asked for.
    efforts: OnceLock<Arc<Efforts>>,
}

impl Parts {
    /// The parts of `actives`. Parts that are unchanged since the fit `before` are taken from there.
    pub fn new(problem: &Problem, actives: &[Active], before: Option<(&[Active], &Self)>) -> Self {
        let mut parts = Self {
            gains: gains(actives, problem.joints),
            transformed: transformed(actives, problem.joints),
            carrier: match before {
                Some((others, before)) if same(actives, others, alters_robot) => {
                    before.carrier.clone()
                }
                _ => carrier(&problem.model, actives).map(Arc::new),
            },
            columns: Vec::with_capacity(actives.len()),
            load: None,
            feeds: (0..problem.joints)
                .map(|joint| feeds(actives, joint))
                .collect(),
            efforts: OnceLock::new(),
        };
        if actives.iter().any(Active::needs_load) {
            let of_bodies = |active: &Active| active.hypothesis.effect.layer == Layer::Body;
            let known = before.filter(|(others, _)| same(actives, others, of_bodies));
            parts.load = known
                .and_then(|(_, before)| before.load.clone())
                .or_else(|| Some(Arc::new(transmitted(problem, actives))));
        }
        for active in actives {
            let part = parts.adds(active).then(|| {
                let known = before.and_then(|(others, before)| {
                    let at = others.iter().position(|other| is_same(active, other))?;
                    let alike = (!active.needs_load()
                        || matches!((&parts.load, &before.load), (Some(a), Some(b)) if Arc::ptr_eq(a, b)))
                        && (!is_on_carrier(active) || same(actives, others, alters_robot));
                    before.columns[at].clone().filter(|_| alike)
                });
                known.unwrap_or_else(|| Arc::new(parts.part(problem, active)))
            });
            parts.columns.push(part);
        }
        parts
    }

    /// Whether an effect only adds to efforts, at joints that no effect transforms.
    fn adds(&self, active: &Active) -> bool {
        let hypothesis = &active.hypothesis;
        if hypothesis.is_torque_scale() {
            return false;
        }
        match hypothesis.only_joint() {
            Some(joint) => !self.transformed[joint],
            None => hypothesis.effect.layer == Layer::Body,
        }
    }

    /// Whether an effect would only add, to joints that no effect transforms and no coupling reads.
    pub fn is_plain(&self, hypothesis: &Hypothesis) -> bool {
        let of_record = hypothesis.effect.layer == Layer::Record && !only_adds(hypothesis);
        !of_record
            && !hypothesis.is_torque_scale()
            && match hypothesis.only_joint() {
                Some(joint) => !self.transformed[joint] && !self.feeds[joint],
                None => !self.transformed.contains(&true),
            }
    }

    /// Whether a coupling adds a joint's effort to another joint's recording.
    pub fn feeds(&self, joint: usize) -> bool {
        self.feeds[joint]
    }

    /// The efforts of all layers, unfiltered.
    pub fn efforts(&self, problem: &Problem, actives: &[Active]) -> &Efforts {
        self.efforts.get_or_init(|| {
            let body = match &self.load {
                Some(load) => Arc::clone(load),
                None => Arc::new(transmitted(problem, actives)),
            };
            Arc::new(evaluated(problem, actives, body))
        })
    }

    /// The effort that the gears transmit, unfiltered.
    pub fn load(&self, problem: &Problem, actives: &[Active]) -> Arc<TrackEfforts> {
        match &self.load {
            Some(load) => Arc::clone(load),
            None => Arc::clone(&self.efforts(problem, actives).body),
        }
    }

    /// The effort that an effect adds by itself, before torque scales.
    pub fn part(&self, problem: &Problem, active: &Active) -> Column {
        let hypothesis = active.hypothesis;
        let joint = hypothesis.only_joint();
        if active.needs_load()
            && let Some(load) = &self.load
        {
            let efforts = Efforts::of_bodies(Arc::clone(load));
            let ones = vec![1.0; problem.joints];
            let on = (&ones[..], None);
            return problem.column(&change(problem, &[], &efforts, active, on), joint);
        }
        let alone = self.carrier.is_none() || !is_on_carrier(active);
        if hypothesis.effect.layer == Layer::Body
            && alone
            && let Some(values) = bodies::signal(problem, active)
        {
            return Column { joint, values };
        }
        if is_kept(problem, active) {
            let units = units(problem, hypothesis, &active.shape());
            let count = problem.rows * joint.map_or(problem.joints, |_| 1);
            let mut values = match &units.alone {
                Some(alone) => alone.values.clone(),
                None => vec![0.0; count],
            };
            let factors = hypothesis
                .factors()
                .into_iter()
                .map(|i| active.coordinates[i]);
            for (unit, factor) in units.factors.iter().zip(factors) {
                for (value, unit) in values.iter_mut().zip(&unit.values) {
                    *value += factor * unit;
                }
            }
            return Column { joint, values };
        }
        let ones = vec![1.0; problem.joints];
        let on = (&ones[..], self.carrier.as_deref());
        let added = change(problem, &[], problem.bare(), active, on);
        problem.column(&added, joint)
    }

    /// The part of an effect before torque scales, if it only adds.
    pub fn of(&self, index: usize) -> Option<&Arc<Column>> {
        self.columns[index].as_ref()
    }

    /// The effort of bodies at a joint, before its torque scale.
    pub fn bodies(&self, problem: &Problem, actives: &[Active], joint: usize) -> Vec<f64> {
        let mut sum = problem.rigid()[problem.joint_rows(joint)].to_vec();
        for (active, part) in actives.iter().zip(&self.columns) {
            let values = part
                .as_ref()
                .filter(|_| active.hypothesis.effect.layer == Layer::Body);
            if let Some(values) = values.and_then(|part| part.of_joint(joint, problem.rows)) {
                add(&mut sum, values);
            }
        }
        sum
    }

    /// The recorded effort at a joint that no effect transforms.
    pub fn recorded(&self, problem: &Problem, actives: &[Active], joint: usize) -> Vec<f64> {
        let mut sum = self.bodies(problem, actives, joint);
        for value in &mut sum {
            *value *= self.gains[joint];
        }
        for (active, part) in actives.iter().zip(&self.columns) {
            let values = part
                .as_ref()
                .filter(|_| active.hypothesis.effect.layer != Layer::Body);
            if let Some(values) = values.and_then(|part| part.of_joint(joint, problem.rows)) {
                add(&mut sum, values);
            }
        }
        sum
    }
}

/// Whether the columns of an effect may be kept. Those with times are not: there are too many intervals; nor are those of
/// an effect that is linear to first order only.
pub fn is_kept(problem: &Problem, active: &Active) -> bool {
    let timeless = |c: &Coordinate| {
        matches!(
            c.kind,
            CoordinateKind::Factor { .. } | CoordinateKind::Shape { .. }
        )
    };
    active.curve.is_none()
        && !active.hypothesis.effect.bends()
        && active.hypothesis.effect.coordinates.iter().all(timeless)
        && problem.rows <= MOST_ROWS
}

fn add(into: &mut [f64], what: &[f64]) {
    for (into, what) in into.iter_mut().zip(what) {
        *into += what;
    }
}

fn only_adds(hypothesis: &Hypothesis) -> bool {
    hypothesis.effect.traits.only_adds
}

/// The joints whose recording an effect transforms; an offset alone does not.
fn transformed(actives: &[Active], joints: usize) -> Vec<bool> {
    let mut transformed = vec![false; joints];
    for active in actives
        .iter()
        .filter(|a| a.is_of_record() && !only_adds(&a.hypothesis))
    {
        if active.hypothesis.effect.place == PlaceKind::All {
            return vec![true; joints];
        }
        transformed[active.hypothesis.place.joint] = true;
    }
    transformed
}

/// Whether two effects are the same, numbers included.
fn is_same(a: &Active, b: &Active) -> bool {
    let bits = |active: &Active| {
        active
            .coordinates
            .iter()
            .map(|x| x.to_bits())
            .collect::<Vec<_>>()
    };
    a.hypothesis == b.hypothesis && a.curve == b.curve && bits(a) == bits(b)
}

/// Whether the effects of a kind are the same in two explanations.
fn same(a: &[Active], b: &[Active], of_kind: impl Fn(&Active) -> bool) -> bool {
    let some = |all| -> Vec<&Active> {
        let all: &[Active] = all;
        all.iter().filter(|active| of_kind(active)).collect()
    };
    let (a, b) = (some(a), some(b));
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| is_same(a, b))
}
