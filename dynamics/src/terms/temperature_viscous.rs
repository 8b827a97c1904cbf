//! Viscous friction that decreases as the joint warms up.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simpler,
    Simulated, Traits, Words,
};

/// Shortest time constant that is searched and reported \[s\]; a faster change is not warming up.
/// Physical: no gearbox warms up at once.
const SEARCHED_FROM_S: f64 = 3.0;
/// Shortest time constant that is drawn \[s\].
/// Chosen: for simulated cells only; just above [`SEARCHED_FROM_S`], because their recordings are short.
const FASTEST_DRAWN_S: f64 = 3.2;

/// Effort (Fw + Fx exp(-t/T)) qd, where t is the time since the start of the recording, at which the joint is cold.
/// No gearbox warms up at once: T is searched from 3 s on, and a shorter one is not reported.
pub(super) static EFFECT: Effect = Effect {
    name: "temperature_viscous",
    words: Words::new(
        "Warm-up friction",
        "viscous friction that falls as the joint warms up",
        "Viscous friction that fades while the joint gets warm.",
        "Joint {place}: the grease of its gear, unless the arm was cold at the start.",
        "The viscous friction of joint {place} falls as it warms up: {viscous_warm_nms_per_rad} warm and {viscous_extra_cold_nms_per_rad} more when cold, within {time_constant_s}.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.0,
    parameters: &[
        Parameter::at_least("viscous_warm_nms_per_rad", 0.0),
        Parameter::at_least("viscous_extra_cold_nms_per_rad", 0.0),
        Parameter::at_least("time_constant_s", 1e-3),
    ],
    coordinates: &[
        Coordinate::positive_factor("viscous_warm_nms_per_rad"),
        Coordinate::positive_factor("viscous_extra_cold_nms_per_rad"),
        Coordinate::shape("time_constant_s", SEARCHED_FROM_S, 900.0, 18, Scale::Log),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::viscous_friction::EFFECT,
        numbers: &["viscous_warm_nms_per_rad"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::Nearest(
        |p| vec![super::Quantity::Damping(p[0])],
        "the friction of the warm joint is written",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let warm = 0.3 + 0.5 * draw.share;
        let time_s = draw.shortest_s * draw.chance.between(0.4, 0.8);
        let time_s = time_s.max(FASTEST_DRAWN_S);
        let fastest = draw.fastest_rad_s;
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("viscous_warm_nms_per_rad", warm * f / fastest),
                ("viscous_extra_cold_nms_per_rad", f / fastest),
                ("time_constant_s", time_s),
            ]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[warm, extra, time_s], j, at| {
            (warm + extra * (-at.recording_s / time_s).exp()) * at.velocity[j]
        })
    },
};
