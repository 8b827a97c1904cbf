//! Friction that depends on the direction of motion, not on its speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler, Simulated,
    Traits, Words, sign,
};

/// Effort F+ max(sgn(qd), 0) + F- min(sgn(qd), 0).
pub(super) static EFFECT: Effect = Effect {
    name: "asymmetric_coulomb",
    words: Words::new(
        "Direction-dependent friction",
        "Coulomb friction that differs by direction",
        "Dry friction that is larger in one direction than in the other.",
        "Joint {place}: gear, seals and brake, for it turns harder one way than the other.",
        "Joint {place} has Coulomb friction of {coulomb_positive_nm} forward and {coulomb_negative_nm} backward that the twin leaves out.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -2.5,
    parameters: &[
        Parameter::at_least("coulomb_positive_nm", 0.0),
        Parameter::at_least("coulomb_negative_nm", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_positive_nm"),
        Coordinate::positive_factor("coulomb_negative_nm"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_positive_nm", "coulomb_negative_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::Nearest(
        |p| vec![super::Quantity::DryFriction(0.5 * (p[0] + p[1]))],
        "simulators have one dry friction for both directions: the mean is written",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let (mut forward, mut back) = (1.0, 0.3 + 0.4 * draw.share);
        if draw.chance.coin() {
            std::mem::swap(&mut forward, &mut back);
        }
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("coulomb_positive_nm", f * forward),
                ("coulomb_negative_nm", f * back),
            ]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[forward, backward], j, at| {
            let direction = sign(at.velocity[j]);
            forward * direction.max(0.0) + backward * direction.min(0.0)
        })
    },
};
