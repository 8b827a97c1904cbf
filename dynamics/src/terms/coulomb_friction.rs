//! Friction that does not depend on speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words, sign,
};

/// Effort Fc sgn(qd) (Siciliano et al., *Robotics*, 2009, equation 7.42).
pub static EFFECT: Effect = Effect {
    name: "coulomb_friction",
    words: Words {
        less: Some("Joint {place} has {less} less Coulomb friction than the twin says."),
        ..Words::new(
            "Coulomb friction",
            "Coulomb friction",
            "A constant resistance against the motion, whatever the speed: dry friction in gear and bearings.",
            "Joint {place}: does its brake drag, its gear or a seal rub, a cable scrape?",
            "Joint {place} has Coulomb friction of {coulomb_nm} that the twin leaves out.",
        )
    },
    family: Family::PlainFriction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -0.3,
    parameters: &[Parameter::at_least("coulomb_nm", 0.0)],
    coordinates: &[Coordinate::positive_factor("coulomb_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::As(|p| vec![super::Quantity::DryFriction(p[0])]),
    simulated: Simulated::Joint,
    concealed: Some(|draw| Drawn::new(draw.efforts_nm(), |f| vec![("coulomb_nm", f)])),
    traits: Traits {
        is_followed: true,
        smallest_told_as: Some("coulomb_nm"),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[fc], j, at| {
            fc * sign(at.velocity[j])
        })
    },
};
