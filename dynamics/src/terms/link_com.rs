//! A link whose centre of mass is not where its URDF says.

use super::ghost::Ghost;
use super::{Coordinate, CoordinateKind, Effect, Layer, Parameter, PlaceKind};
use crate::Inertia;

/// A shift of a link's centre of mass, in the link's frame; its mass and the inertia about the centre
/// stay. To first order linear in the shift.
pub(super) static EFFECT: Effect = Effect {
    name: "link_com",
    place: PlaceKind::Link,
    layer: Layer::Body,
    parameters: &[
        Parameter::any("delta_com_x_m"),
        Parameter::any("delta_com_y_m"),
        Parameter::any("delta_com_z_m"),
    ],
    coordinates: &[
        shift("delta_com_x_m"),
        shift("delta_com_y_m"),
        shift("delta_com_z_m"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        let link = &site.model.links()[site.link];
        let (mass_kg, com_m) = (link.mass_kg(), link.com_m());
        let shifted = std::array::from_fn(|i| com_m[i] + values[i]);
        let body = |com_m| Inertia::new(mass_kg, com_m, [0.0; 6]);
        Ghost::boxed(&EFFECT, site, values, body(shifted) - body(com_m), None)
    },
};

const fn shift(name: &'static str) -> Coordinate {
    let kind = CoordinateKind::Factor {
        step: 1e-3,
        minimum: f64::NEG_INFINITY,
    };
    Coordinate { name, kind }
}
