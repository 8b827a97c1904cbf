//! Friction proportional to the effort that the gear transmits.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words, sign,
};

/// Effort μ |τ| sgn(qd), τ being the rigid body's effort without friction.
pub(super) static EFFECT: Effect = Effect {
    name: "load_dependent_friction",
    words: Words::new(
        "Load-dependent friction",
        "load dependent friction",
        "Friction that grows with the torque through the gear: the joint rubs more the more it carries.",
        "Joint {place}: lubrication of the gear, for it rubs more the more it carries.",
        "The friction of joint {place} grows with the load on its gear, by {coefficient} of it.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -3.0,
    parameters: &[Parameter::ratio("coefficient", 0.0)],
    coordinates: &[Coordinate::positive_factor("coefficient")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No(
        "no attribute of these targets has friction that grows with the load",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|_| Drawn::new([1e-4, 0.5], |c| vec![("coefficient", c)])),
    traits: Traits {
        needs_load: true,
        smallest_told_as: Some("coefficient"),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[mu], j, at| {
            mu * at.transmitted[j].abs() * sign(at.velocity[j])
        })
    },
};
