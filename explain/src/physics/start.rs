//! Effects of the corrected twin from which an explanation starts. New effects are reported in addition to them.

use std::collections::BTreeMap;

use tauscope_dynamics::Model;
use tauscope_dynamics::terms::{Layer, Physics, TermError, TermSpec};

use crate::data::track::Track;
use crate::physics::friction;
use crate::read::start::Start;

impl Start {
    /// Returns the plain friction and rotor inertia that the twin contains, by joint and effect name, in the units of
    /// its terms. A fit may reduce each by at most this value.
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

    /// Adds the twin's bodies to the rigid effort of a track, and stores the effort of its other terms separately, so
    /// that a new body has the same scale as the old ones. `loads` are new bodies, which also load the gears.
    /// `constants` convert the recording's unit into the model's, by joint. `gain` converts the effort of bodies from
    /// the model's unit into the recording's, by joint.
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
        // All effort that the twin predicts except the scaled effort of the bodies, which the fit adds itself.
        track.beside = run(track, &beside, &effort)?;
        for (k, value) in track.beside.iter_mut().enumerate() {
            let j = k % n;
            *value = *value / constants[j] + self.offset[j] - gain[j] * borne[k];
        }
        Ok(())
    }
}
