//! Friction that falls from a static to a kinetic value as the joint starts to move.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simpler,
    Simulated, Traits, Words, sign,
};

/// Least and largest Stribeck velocity \[rad/s\].
/// Physical: full lubrication begins near 9 rad/s of a motor (Bittencourt and Gunnarsson, "Static Friction in a Robot
/// Joint", *Journal of Dynamic Systems, Measurement, and Control* 134, 2012), and gears of arms reduce by ten or more.
const SPEEDS_RAD_S: [f64; 2] = [0.02, 1.0];

/// Effort (Fc + (Fs - Fc) exp(-(qd/vs)²)) sgn(qd) (Armstrong-Hélouvry, Dupont and Canudas de Wit, "A
/// survey of models, analysis tools and compensation methods for the control of machines with
/// friction", 1994, equation 2, with the exponent 2).
pub(super) static EFFECT: Effect = Effect {
    name: "stribeck_friction",
    words: Words::new(
        "Stribeck friction",
        "Stribeck friction",
        "Friction that is highest when motion begins and falls with speed: the joint sticks before it slips.",
        "Joint {place}: lubrication of gear and bearings; does it stick before it moves?",
        "Joint {place} has friction that falls from {static_nm} at standstill to {coulomb_nm} in motion, over {stribeck_velocity_rad_s} that the twin leaves out.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -1.5,
    parameters: &[
        Parameter::at_least("coulomb_nm", 0.0),
        Parameter::at_least("static_nm", 0.0),
        Parameter::at_least("stribeck_velocity_rad_s", 1e-6),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_nm"),
        Coordinate::positive_factor("static_excess_nm"),
        Coordinate::shape(
            "stribeck_velocity_rad_s",
            SPEEDS_RAD_S[0],
            SPEEDS_RAD_S[1],
            9,
            Scale::Log,
        ),
    ],
    to_parameters: |c| vec![c[0], c[0] + c[1], c[2]],
    to_coordinates: |p| vec![p[0], p[1] - p[0], p[2]],
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_nm", "static_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::Nearest(
        |p| {
            vec![
                super::Quantity::DryFriction(p[0]),
                super::Quantity::StaticFriction(p[1]),
            ]
        },
        "friction in motion is written, and friction at rest where the target has it; the fall in between has no attribute",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let more = 1.5 + draw.share;
        let speed = draw.fastest_rad_s * draw.chance.between(0.04, 0.12);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("coulomb_nm", f),
                ("static_nm", f * more),
                ("stribeck_velocity_rad_s", speed),
            ]
        })
    }),
    traits: Traits {
        is_fast: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[fc, excess, vs], j, at| {
            let ratio = at.velocity[j] / vs;
            (fc + excess * (-ratio * ratio).exp()) * sign(at.velocity[j])
        })
    },
};
