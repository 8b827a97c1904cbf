//! Coulomb friction that jumps once.

use super::law::joint_law;
use super::{
    Coordinate, CoordinateKind, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind,
    Simpler, Simulated, Traits, Words, sign,
};

/// Effort F sgn(qd), F being one value before a time of the session and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "friction_step",
    words: Words::new(
        "Friction step",
        "Coulomb friction that changed once",
        "Friction that changed once and stayed: a brake that drags, a bearing that failed, grease that was renewed.",
        "Joint {place}: what changed then? A brake that drags, a bearing, new grease.",
        "The Coulomb friction of joint {place} jumped from {coulomb_before_nm} to {coulomb_after_nm}, {change_time_session_s} into the session.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.5,
    parameters: &[
        Parameter::at_least("coulomb_before_nm", 0.0),
        Parameter::at_least("coulomb_after_nm", 0.0),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_before_nm"),
        Coordinate::positive_factor("coulomb_after_nm"),
        Coordinate {
            name: "change_time_session_s",
            kind: CoordinateKind::SessionTime,
        },
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_after_nm", "coulomb_before_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::No(super::export::CHANGES),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let before = 0.2 + 0.3 * draw.share;
        let change_s = draw.start_session_s + draw.shortest_s * draw.chance.between(0.3, 0.7);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("coulomb_before_nm", f * before),
                ("coulomb_after_nm", f),
                ("change_time_session_s", change_s),
            ]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[before, after, time_s], j, at| {
            let coulomb = at.stepped([*before, *after], *time_s);
            coulomb * sign(at.velocity[j])
        })
    },
};
