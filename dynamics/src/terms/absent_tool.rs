//! A body of the twin that the arm does not carry.

use super::ghost::{Ghost, While};
use super::law::array;
use super::payload::{BODY_COORDINATES, BODY_PARAMETERS, inertia, parameters};
use super::{Effect, Excitation, Family, Layer, PlaceKind, Simulated, Traits, Words};
use crate::{Inertia, Model};

/// Smallest missing share of the carried mass that is reported as an absent tool: the bodies of a URDF may be wrong
/// by less.
/// Physical: a fifth; drawings and weighed arms differ by a twentieth to a tenth.
pub const LEAST_ABSENT: f64 = 0.2;

/// Mass \[kg\] as a share of the mass that the joint of a link carries in the model, up to the next joint.
pub fn share_of_carried(model: &Model, link: usize, mass_kg: f64) -> f64 {
    let links = model.links();
    let same = links.iter().filter(|one| one.joint == links[link].joint);
    mass_kg / same.map(|one| one.inertia.mass_kg()).sum::<f64>()
}

/// A payload with the opposite sign: the URDF has a gripper that is not mounted, or one that is heavier than the real
/// one.
pub static EFFECT: Effect = Effect {
    name: "absent_tool",
    words: Words::new(
        "Absent tool",
        "a tool that is not there",
        "The twin carries something at the tool that the arm does not, or something heavier.",
        "The tool: is what the URDF has there mounted, and as heavy?",
        "The arm lacks {mass_kg} at the tool that the twin carries.",
    ),
    family: Family::Body,
    place: PlaceKind::Tool,
    layer: Layer::Body,
    odds_nats: -3.0,
    parameters: &BODY_PARAMETERS,
    coordinates: &BODY_COORDINATES,
    to_parameters: |c| parameters(&array(c)).to_vec(),
    to_coordinates: |p| inertia(&array(p)).parameters().to_vec(),
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Body]),
    simulated: Simulated::Model,
    // The bodies that can be removed depend on the URDF.
    concealed: None,
    traits: Traits {
        is_off_list: true,
        smallest_told_as: Some("mass_kg"),
        ..Traits::NONE
    },
    build: |site, values| {
        let lacking = Inertia::zero() - Inertia::from_parameters(array(values));
        Ghost::boxed(&EFFECT, site, values, lacking, While::Always)
    },
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion, run};
    use super::*;

    #[test]
    fn takes_off_what_a_payload_puts_on() {
        let robot = TwoJoints::new();
        let site = robot.site_for(PlaceKind::Tool);
        let body = [2.0, 0.1, 0.0, 0.2, 0.1, 0.0, 0.0, 0.1, 0.0, 0.05];
        let mut there = (super::super::payload::EFFECT.build)(&site, &body);
        let mut absent = (EFFECT.build)(&site, &body);
        let motion = motion(&robot.model, 100);
        let put_on = run(&mut *there, &motion);
        for (on, off) in put_on.iter().zip(run(&mut *absent, &motion)) {
            assert!(on.iter().zip(off).all(|(on, off)| (on + off).abs() < 1e-12));
        }
    }
}
