//! Friction in proportion to what the gear transmits.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, sign};

/// Effort μ |τ| sgn(qd), τ being the rigid body's effort without friction.
pub(super) static EFFECT: Effect = Effect {
    name: "load_dependent_friction",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[Parameter::at_least("coefficient", 0.0)],
    coordinates: &[Coordinate::positive_factor("coefficient")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[mu], j, at| {
            mu * at.transmitted[j].abs() * sign(at.velocity[j])
        })
    },
};
