//! Friction that depends on the direction of motion, not on its speed.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, sign};

/// Effort F+ max(sgn(qd), 0) + F- min(sgn(qd), 0).
pub(super) static EFFECT: Effect = Effect {
    name: "asymmetric_coulomb",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
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
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[forward, backward], j, at| {
            let direction = sign(at.velocity[j]);
            forward * direction.max(0.0) + backward * direction.min(0.0)
        })
    },
};
