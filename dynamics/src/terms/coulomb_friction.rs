//! Friction that does not depend on speed.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, sign};

/// Effort Fc sgn(qd) (Siciliano et al., *Robotics*, 2009, equation 7.42).
pub(super) static EFFECT: Effect = Effect {
    name: "coulomb_friction",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[Parameter::at_least("coulomb_nm", 0.0)],
    coordinates: &[Coordinate::positive_factor("coulomb_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[fc], j, at| {
            fc * sign(at.velocity[j])
        })
    },
};
