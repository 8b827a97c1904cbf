//! Friction in proportion to the square of the speed.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Effort c qd |qd|.
pub(super) static EFFECT: Effect = Effect {
    name: "quadratic_drag",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[Parameter::at_least("drag_nms2_per_rad2", 0.0)],
    coordinates: &[Coordinate::positive_factor("drag_nms2_per_rad2")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[c], j, at| {
            c * at.velocity[j] * at.velocity[j].abs()
        })
    },
};
