//! A spring that turns with the joint like a weight, to carry the arm.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Effort A sin(q - q0), searched as A cos q0 sin q - A sin q0 cos q.
pub(super) static EFFECT: Effect = Effect {
    name: "counterbalance_spring",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("amplitude_nm", 0.0),
        Parameter::any("rest_angle_rad"),
    ],
    coordinates: &[
        Coordinate::factor("sine_nm"),
        Coordinate::factor("cosine_nm"),
    ],
    to_parameters: |c| vec![c[0].hypot(c[1]), (0.0 - c[1]).atan2(c[0])],
    to_coordinates: |p| vec![p[0] * p[1].cos(), -p[0] * p[1].sin()],
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[sine, cosine], j, at| {
            let (sin, cos) = at.position[j].sin_cos();
            sine * sin + cosine * cos
        })
    },
};
