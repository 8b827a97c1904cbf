//! Viscous friction that changes once.

use super::law::joint_law;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler,
    Simulated, Traits, Words,
};

/// Effort Fv qd, Fv being one value before a time of the session and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "viscous_step",
    words: Words::new(
        "Viscous friction that changed",
        "viscous friction that changed once",
        "Viscous friction that changed once and stayed: a cold start, new grease, another lubricant.",
        "Joint {place}: what changed then? Grease that was renewed or ran out, a gear that was cold before.",
        "The viscous friction of joint {place} changed from {viscous_before_nms_per_rad} to {viscous_after_nms_per_rad}, \
         {change_time_session_s} into the session.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("viscous_before_nms_per_rad", 0.0),
        Parameter::at_least("viscous_after_nms_per_rad", 0.0),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::positive_factor("viscous_before_nms_per_rad"),
        Coordinate::positive_factor("viscous_after_nms_per_rad"),
        time("change_time_session_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::viscous_friction::EFFECT,
        numbers: &["viscous_after_nms_per_rad", "viscous_before_nms_per_rad"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::No(super::export::CHANGES),
    simulated: Simulated::Joint,
    concealed: None,
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[before, after, time_s], j, at| {
            let viscous = at.stepped([*before, *after], *time_s);
            viscous * at.velocity[j]
        })
    },
};
