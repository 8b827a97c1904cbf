//! A cable or hose that pulls the joint back to where it hangs loose.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Softer than this it is no spring \[N m/rad\].
const LEAST_STIFFNESS: f64 = 1e-9;

/// Effort k (q - q0), searched as k q plus a constant.
pub(super) static EFFECT: Effect = Effect {
    name: "cable_spring",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("stiffness_nm_per_rad", 0.0),
        Parameter::any("rest_angle_rad"),
    ],
    coordinates: &[
        Coordinate::positive_factor("stiffness_nm_per_rad"),
        Coordinate::factor("constant_nm"),
    ],
    to_parameters: |c| {
        let stiffness = c[0].max(0.0);
        vec![stiffness, (0.0 - c[1]) / stiffness.max(LEAST_STIFFNESS)]
    },
    to_coordinates: |p| vec![p[0], -p[0] * p[1]],
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[stiffness, constant], j, at| {
            stiffness * at.position[j] + constant
        })
    },
};
