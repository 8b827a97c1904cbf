//! Friction that depends on the direction of motion, not on its speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler, Simulated,
    Traits, Words, sign,
};

/// Friction of one direction is at least this share of the other's; what looks more lopsided is friction and an offset.
/// Tuned: not swept.
const LEAST_SYMMETRY: f64 = 0.2;
/// And at most this share: what looks less lopsided is friction and a small offset, which every sensor has.
/// Physical: a tenth is what bodies that are a few per cent off make of plain friction.
const MOST_SYMMETRY: f64 = 0.9;

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
    limit: Some(|_, x| {
        let (less, more) = (x[0].min(x[1]), x[0].max(x[1]));
        (LEAST_SYMMETRY * more..=MOST_SYMMETRY * more).contains(&less)
    }),
    excitation: Excitation::Speeds,
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
