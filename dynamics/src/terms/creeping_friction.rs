//! Dry friction that allows a joint to creep instead of standing still.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simpler,
    Simulated, Traits, Words,
};

/// Smallest and largest speed at which the friction reaches its full value \[rad/s\].
/// Physical: with `MuJoCo`'s default `solref` and `solimp` about F/(947 M) in steady motion, where M is the inertia that the joint
/// moves: 0.005 at a shoulder, 0.5 at a light wrist, and a margin.
const SPEEDS_RAD_S: [f64; 2] = [0.005, 2.0];

/// Effort Fc max(-1, min(1, qd/v0)): Coulomb friction with a linear transition (Andersson, Söderberg and Björklund, "Friction models
/// for sliding dry, boundary and mixed lubricated contacts", *Tribology International* 40, 2007). Nearest to `MuJoCo`'s
/// `frictionloss`, a soft constraint: about -9 M (qdd + 105 qd) until it is full.
pub(super) static EFFECT: Effect = Effect {
    name: "creeping_friction",
    words: Words::new(
        "Creeping friction",
        "creeping friction",
        "Dry friction that grows with the speed until it is full: the joint creeps in place of standing still.",
        "Joint {place}: were the recordings simulated? MuJoCo computes dry friction so.",
        "Joint {place} has dry friction of {coulomb_nm} that is full from {full_velocity_rad_s} on and that the twin leaves out.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -3.5,
    parameters: &[
        Parameter::at_least("coulomb_nm", 0.0),
        Parameter::at_least("full_velocity_rad_s", 1e-6),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_nm"),
        Coordinate::shape(
            "full_velocity_rad_s",
            SPEEDS_RAD_S[0],
            SPEEDS_RAD_S[1],
            10,
            Scale::Log,
        ),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::coulomb_friction::EFFECT,
        numbers: &["coulomb_nm"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::Nearest(
        |p| vec![super::Quantity::DryFriction(p[0])],
        "the dry friction is written; the speed at which it is full is the simulator's own",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let speed = draw.fastest_rad_s * draw.chance.between(0.05, 0.15);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![("coulomb_nm", f), ("full_velocity_rad_s", speed)]
        })
    }),
    traits: Traits {
        is_fast: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[fc, full], j, at| {
            fc * (at.velocity[j] / full).clamp(-1.0, 1.0)
        })
    },
};
