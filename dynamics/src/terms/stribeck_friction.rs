//! Friction that falls from a static to a kinetic value as the joint starts to move.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, Scale, sign};

/// Effort (Fc + (Fs - Fc) exp(-(qd/vs)²)) sgn(qd) (Armstrong-Hélouvry, Dupont and Canudas de Wit, "A
/// survey of models, analysis tools and compensation methods for the control of machines with
/// friction", 1994, equation 2, with the exponent 2).
pub(super) static EFFECT: Effect = Effect {
    name: "stribeck_friction",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("coulomb_nm", 0.0),
        Parameter::at_least("static_nm", 0.0),
        Parameter::at_least("stribeck_velocity_rad_s", 1e-6),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_nm"),
        Coordinate::positive_factor("static_excess_nm"),
        Coordinate::shape("stribeck_velocity_rad_s", 0.02, 5.0, 12, Scale::Log),
    ],
    to_parameters: |c| vec![c[0], c[0] + c[1], c[2]],
    to_coordinates: |p| vec![p[0], p[1] - p[0], p[2]],
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[fc, excess, vs], j, at| {
            let ratio = at.velocity[j] / vs;
            (fc + excess * (-ratio * ratio).exp()) * sign(at.velocity[j])
        })
    },
};
