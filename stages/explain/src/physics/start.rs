//! A corrected twin to start from: what is new is told beside what it knows already.

use std::collections::BTreeMap;

use tauscope_dynamics::terms::{Against, Effect, Layer, Physics, TermError, TermSpec};
use tauscope_dynamics::{Data, Model, gravity_effort};

use crate::data::track::Track;
use crate::explain::Input;
use crate::physics::active::{Hypothesis, Whereabouts};
use crate::physics::friction;

/// A known scale is at least this many times its own deviation.
pub const KNOWN: f64 = 5.0;

/// And one that is better than none.
const LIKELY: f64 = 2.0;

/// A joint bears weight from this share of what the one that bears most does.
const BEARS: f64 = 0.1;

/// A corrected twin.
#[derive(Debug, Clone, Default)]
pub struct Start {
    /// Its physics.
    pub terms: Vec<TermSpec>,
    /// Gain of each joint's bodies \[effort unit per model unit\].
    pub gain: Vec<f64>,
    /// Standard deviation of each gain that stands for a torque constant: 0 where it is exact, infinite where it tells nothing.
    pub gain_deviation: Vec<f64>,
    /// Offset of each joint \[effort unit\].
    pub offset: Vec<f64>,
}

impl Start {
    /// Whether the gain of a joint tells how many N m its effort is.
    pub fn is_scale_known(&self, joint: usize) -> bool {
        self.gain[joint] > KNOWN * self.gain_deviation[joint]
    }

    /// N m per recorded unit by joint, where the gains stand for torque constants; 1 where a gain tells nothing.
    pub fn units_nm(&self) -> Vec<f64> {
        let of = |joint| {
            if self.is_scale_known(joint) {
                1.0 / self.gain[joint]
            } else {
                1.0
            }
        };
        (0..self.gain.len()).map(of).collect()
    }

    /// The likeliest N m per recorded unit by joint, where the gains stand for torque constants: of a gain that tells next to nothing
    /// the middle one of the others.
    pub fn likely_units_nm(&self) -> Vec<f64> {
        let gains = self.gain.iter().zip(&self.gain_deviation);
        let told = gains.map(|(gain, deviation)| (*gain > LIKELY * deviation).then(|| 1.0 / gain));
        filled(&told.collect::<Vec<_>>())
    }

    /// Whether something of it depends on what the gears transmit.
    pub fn needs_load(&self) -> bool {
        let needs = |term: &TermSpec| {
            let against = term.table.as_ref().map(|table| table.against);
            let needs = |effect: &Effect| effect.traits.needs_load;
            term.effect().is_ok_and(needs) || against == Some(Against::Load)
        };
        self.terms.iter().any(needs)
    }

    /// By joint, whether it has friction that takes any value at rest.
    pub fn is_dry(&self, model: &Model) -> Vec<bool> {
        let mut dry = vec![false; model.dof()];
        for spec in &self.terms {
            let joint = (spec.joint.as_ref()).and_then(|name| model.joint_index(name));
            let (Some(joint), Ok(effect)) = (joint, spec.effect()) else {
                continue;
            };
            let place = Whereabouts {
                joint,
                ..Whereabouts::default()
            };
            dry[joint] |= match &spec.table {
                Some(table) => table.by_direction,
                None => Hypothesis { effect, place }.is_set_valued(model),
            };
        }
        dry
    }

    /// Coulomb and viscous friction by joint and name, in units of its terms: by so much they may have fallen since.
    pub fn friction(&self, model: &Model) -> Vec<BTreeMap<&'static str, f64>> {
        let mut all = vec![BTreeMap::new(); model.dof()];
        for spec in &self.terms {
            let joint = (spec.joint.as_ref()).and_then(|name| model.joint_index(name));
            if let (Some(joint), Some((name, own))) = (joint, friction::of(spec)) {
                *all[joint].entry(name).or_insert(0.0) += own;
            }
        }
        all
    }

    /// Puts the twin's bodies into what bodies cost along a track, and all else it says beside them: so that what a new body costs
    /// is on the same scale as the old ones. `loads` are new bodies that the gears are known to bear, too. `constants` turn the
    /// recording's unit into the model's, and `gain` is what the bodies of each joint are taken by, from the model's unit into the
    /// recording's.
    ///
    /// # Errors
    /// If a term cannot be built for the robot.
    pub fn apply(
        &self,
        track: &mut Track,
        model: &Model,
        loads: &[TermSpec],
        constants: &[f64],
        gain: &[f64],
    ) -> Result<(), TermError> {
        let n = gain.len();
        let of_bodies = |spec: &&TermSpec| spec.effect().is_ok_and(|e| e.layer == Layer::Body);
        let (bodies, beside): (Vec<_>, Vec<_>) = self.terms.iter().partition(of_bodies);
        let run = |track: &Track, terms: &[&TermSpec], from: &[f64]| {
            let built = terms.iter().map(|spec| spec.build(model));
            let mut physics = Physics::new(built.collect::<Result<_, _>>()?, n);
            Ok(track.run(&mut physics, from))
        };
        track.rigid = run(track, &bodies, &track.rigid)?;
        let borne = run(track, &loads.iter().collect::<Vec<_>>(), &track.rigid)?;
        let scaled = borne.iter().enumerate();
        let effort: Vec<f64> = scaled.map(|(k, x)| x * self.gain[k % n]).collect();
        track.beside = run(track, &beside, &effort)?;
        for (k, value) in track.beside.iter_mut().enumerate() {
            let j = k % n;
            *value = *value / constants[j] + self.offset[j] - gain[j] * borne[k];
        }
        Ok(())
    }
}

/// The middle one of the known, or 1, where nothing is known.
fn filled(known: &[Option<f64>]) -> Vec<f64> {
    let mut told: Vec<f64> = known.iter().copied().flatten().collect();
    told.sort_by(f64::total_cmp);
    let middle = told.get(told.len() / 2).copied().unwrap_or(1.0);
    known.iter().map(|unit| unit.unwrap_or(middle)).collect()
}

/// About how many N m a recorded unit is by joint, from what gravity asks of an arm at rest: friction bears part of it, so that forces that
/// hang on this are no more than about right.
fn units_under_gravity(input: &Input) -> Vec<f64> {
    let n = input.model.dof();
    let mut data = Data::new(&input.model);
    let (mut weight_nm, mut effort) = (vec![0.0; n], vec![0.0; n]);
    for recording in &input.fit {
        let rows = recording
            .position
            .chunks_exact(n)
            .zip(recording.effort.chunks_exact(n));
        for (position, measured) in rows {
            let gravity = gravity_effort(&input.model, &mut data, position);
            for j in 0..n {
                weight_nm[j] += gravity[j];
                effort[j] += measured[j];
            }
        }
    }
    let most_nm = weight_nm.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
    let unit = |j: usize| {
        let unit = weight_nm[j] / effort[j];
        (weight_nm[j].abs() > BEARS * most_nm && unit.is_finite() && unit > 0.0).then_some(unit)
    };
    filled(&(0..n).map(unit).collect::<Vec<_>>())
}

/// N m per recorded unit by joint, and the joints of which nobody knows it, with the gain that their bodies are taken by at first.
pub fn scales(input: &Input, constants: &[f64], at_rest: bool) -> (Vec<f64>, Vec<(usize, f64)>) {
    if input.effort_unit != "A" || input.torque_constants_nm_per_a.is_some() {
        return (constants.to_vec(), Vec::new());
    }
    let joints = 0..constants.len();
    let Some(start) = &input.start else {
        // At rest nothing else would tell them.
        let units_nm = if at_rest {
            units_under_gravity(input)
        } else {
            constants.to_vec()
        };
        return (units_nm, joints.map(|j| (j, 1.0)).collect());
    };
    let unknown = joints.filter(|&j| !start.is_scale_known(j));
    let unknown = unknown.map(|j| (j, start.gain[j])).collect();
    let units_nm = if at_rest {
        start.likely_units_nm()
    } else {
        start.units_nm()
    };
    (units_nm, unknown)
}
