//! A link whose centre of mass differs from its URDF.

use super::ghost::{Ghost, While};
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};
use crate::Inertia;

/// Largest offset of a centre of mass that is drawn at random \[m\].
/// Chosen: for simulated cells only; cables, covers and motors that a CAD model lacks shift a link's centre by some
/// centimetres.
const MOST_DRAWN_M: f64 = 0.06;

/// Shift of a link's centre of mass, in the link's frame; its mass and the inertia about the centre stay the same. To
/// first order linear in the shift.
pub static EFFECT: Effect = Effect {
    name: "link_com",
    words: Words::new(
        "Link centre of mass",
        "another centre of mass",
        "A link's mass is distributed otherwise than its model says.",
        "Link {place}: what is mounted on it, and where, that the URDF does not have?",
        "The centre of mass of link {place} is off by ({delta_com_x_m}, {delta_com_y_m}, {delta_com_z_m}) in its frame.",
    ),
    family: Family::Body,
    place: PlaceKind::Link,
    layer: Layer::Body,
    odds_nats: -3.0,
    parameters: &[
        Parameter::any("delta_com_x_m"),
        Parameter::any("delta_com_y_m"),
        Parameter::any("delta_com_z_m"),
    ],
    coordinates: &[
        Coordinate::bending_factor("delta_com_x_m"),
        Coordinate::bending_factor("delta_com_y_m"),
        Coordinate::bending_factor("delta_com_z_m"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Body]),
    simulated: Simulated::Model,
    concealed: Some(|draw| {
        let names = ["delta_com_x_m", "delta_com_y_m", "delta_com_z_m"];
        Drawn::new([1e-4, MOST_DRAWN_M], draw.along(names))
    }),
    traits: Traits::NONE,
    build: |site, values| {
        let link = &site.model.links()[site.link];
        let (mass_kg, com_m) = (link.mass_kg(), link.com_m());
        let shifted = std::array::from_fn(|i| com_m[i] + values[i]);
        let body = |com_m| Inertia::new(mass_kg, com_m, [0.0; 6]);
        Ghost::boxed(
            &EFFECT,
            site,
            values,
            body(shifted) - body(com_m),
            While::Always,
        )
    },
};
