//! Terms of the friction, rotors and springs in a robot file.

use std::collections::BTreeMap;

use super::{COULOMB_FRICTION, Effect, TermSpec, VISCOUS_FRICTION, cable_spring, rotor_inertia};
use crate::Model;

/// Friction, rotors and springs of the joints as the robot's file states them ([`crate::Drive`]).
pub fn of_drives(model: &Model) -> Vec<TermSpec> {
    let mut all = Vec::new();
    for joint in model.joints() {
        let drive = joint.drive;
        let mut add = |effect: &Effect, values: &[f64]| {
            if values.first().is_some_and(|size| *size > 0.0) {
                let names = effect.parameters.iter().map(|p| p.name.to_owned());
                all.push(TermSpec {
                    effect: effect.name.to_owned(),
                    joint: Some(joint.name.clone()),
                    parameters: names
                        .zip(values.iter().copied())
                        .collect::<BTreeMap<_, _>>(),
                    ..TermSpec::default()
                });
            }
        };
        add(&VISCOUS_FRICTION, &[drive.damping]);
        add(&COULOMB_FRICTION, &[drive.friction]);
        add(&rotor_inertia::EFFECT, &[drive.rotor_inertia]);
        add(&cable_spring::EFFECT, &[drive.stiffness, drive.rest]);
    }
    all
}
