//! A link that is heavier or lighter than its URDF says.

use super::ghost::Ghost;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};
use crate::Inertia;

/// A change of a link's mass; its centre of mass and the inertia about that stay, so it is a point mass
/// at the centre of mass.
pub(super) static EFFECT: Effect = Effect {
    name: "link_mass",
    place: PlaceKind::Link,
    layer: Layer::Body,
    parameters: &[Parameter::any("delta_mass_kg")],
    coordinates: &[Coordinate::factor("delta_mass_kg")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        let com_m = site.model.links()[site.link].com_m();
        let inertia = Inertia::new(values[0], com_m, [0.0; 6]);
        Ghost::boxed(&EFFECT, site, values, inertia, None)
    },
};
