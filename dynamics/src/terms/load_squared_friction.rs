//! Friction proportional to the square of the effort that the gear transmits: the next term of the series in the load
//! after the linear one (P. Hamon, M. Gautier and P. Garrec, "Dynamic Identification of Robots with a Dry Friction
//! Model Depending on Load and Velocity", IROS 2010). Parts that deform under load rub in this way.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words, sign,
};

/// Effort c τ² sgn(qd), τ being the rigid body's effort without friction.
pub(super) static EFFECT: Effect = Effect {
    name: "load_squared_friction",
    words: Words::new(
        "Friction by the square of the load",
        "friction by the square of the load",
        "Friction that grows faster than the torque through the gear: its parts bend under load and rub.",
        "Joint {place}: the gear, for worn or bent teeth, too little preload, or lubricant that the load presses out.",
        "The friction of joint {place} grows with the square of the load on its gear, by {coefficient_per_nm}.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[Parameter::at_least("coefficient_per_nm", 0.0)],
    coordinates: &[Coordinate::positive_factor("coefficient_per_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No(
        "no attribute of these targets has friction that grows with the load",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let largest = draw.largest_nm.max(1e-3);
        Drawn::new([1e-4, 0.5], move |share| {
            vec![("coefficient_per_nm", share / largest)]
        })
    }),
    traits: Traits {
        needs_load: true,
        is_off_list: true,
        smallest_told_as: Some("coefficient_per_nm"),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[c], j, at| {
            c * at.transmitted[j] * at.transmitted[j] * sign(at.velocity[j])
        })
    },
};
