//! Friction that a controller subtracts from the effort before it publishes it, and subtracts too much of.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words, sign,
};

/// Effort -F sgn(qd): what is left of the friction drives the joint, which no friction does.
pub(super) static EFFECT: Effect = Effect {
    name: "subtracted_friction",
    words: Words::new(
        "Friction subtracted twice",
        "friction that was subtracted from the effort",
        "The effort falls short in the direction of motion: a model of the friction was taken off it that is larger than the friction.",
        "Joint {place}: does the controller publish its effort less a friction model, or is friction compensated in the driver as well?",
        "The recorded effort of joint {place} has {subtracted_nm} more Coulomb friction subtracted than the joint has.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    parameters: &[Parameter::at_least("subtracted_nm", 0.0)],
    coordinates: &[Coordinate::positive_factor("subtracted_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    limit: None,
    excitation: Excitation::Speeds,
    simulated: Simulated::Record,
    concealed: Some(|draw| Drawn::new(draw.efforts_nm(), |f| vec![("subtracted_nm", f)])),
    traits: Traits {
        only_adds: true,
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[subtracted], j, at| {
            -subtracted * sign(at.velocity[j])
        })
    },
};
