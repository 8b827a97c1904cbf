//! Friction in proportion to speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Effort Fv qd (Siciliano et al., *Robotics*, 2009, equation 7.42).
pub static EFFECT: Effect = Effect {
    name: "viscous_friction",
    words: Words {
        less: Some("Joint {place} has {less} less viscous friction than the twin says."),
        ..Words::new(
            "Viscous friction",
            "viscous friction",
            "Resistance that grows with speed: grease, seals, gear churning.",
            "Joint {place}: grease of gear and bearings; the wrong one, too much of it, or cold?",
            "Joint {place} has viscous friction of {viscous_nms_per_rad} that the twin leaves out.",
        )
    },
    family: Family::PlainFriction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -0.5,
    parameters: &[Parameter::at_least("viscous_nms_per_rad", 0.0)],
    coordinates: &[Coordinate::positive_factor("viscous_nms_per_rad")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::As(|p| vec![super::Quantity::Damping(p[0])]),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let fastest = draw.fastest_rad_s;
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![("viscous_nms_per_rad", f / fastest)]
        })
    }),
    traits: Traits {
        is_followed: true,
        smallest_told_as: Some("viscous_nms_per_rad"),
        ..Traits::NONE
    },
    build: |site, values| joint_law(&EFFECT, site, values, |[fv], j, at| fv * at.velocity[j]),
};
