//! A link that is heavier or lighter than its URDF says.

use super::ghost::{Ghost, While};
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};
use crate::Inertia;

/// Largest error of a mass that is drawn at random, as a share of the link's mass.
/// Chosen: for simulated cells only; several times the usual error of a URDF's mass, a tenth, and less than the whole
/// mass.
const MOST_DRAWN: f64 = 0.6;

/// Change of a link's mass; its centre of mass and the inertia about it stay the same, so it is a point mass at the
/// centre of mass.
pub(super) static EFFECT: Effect = Effect {
    name: "link_mass",
    words: Words {
        less: Some("Link {place} is lighter than in the URDF by {less}."),
        ..Words::new(
            "Link mass",
            "another mass",
            "A link is heavier or lighter than its model says.",
            "Link {place}: what is mounted on it or missing from it, against the URDF?",
            "Link {place} is heavier than in the URDF by {delta_mass_kg}.",
        )
    },
    family: Family::Body,
    place: PlaceKind::Link,
    layer: Layer::Body,
    odds_nats: -4.0,
    parameters: &[Parameter::any("delta_mass_kg")],
    coordinates: &[Coordinate::factor("delta_mass_kg")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Body]),
    simulated: Simulated::Model,
    concealed: Some(|draw| {
        let most = MOST_DRAWN * draw.site.model.links()[draw.site.link].mass_kg();
        Drawn::new([1e-3 * most, most], |mass| vec![("delta_mass_kg", mass)])
    }),
    traits: Traits::NONE,
    build: |site, values| {
        let com_m = site.model.links()[site.link].com_m();
        let inertia = Inertia::new(values[0], com_m, [0.0; 6]);
        Ghost::boxed(&EFFECT, site, values, inertia, While::Always)
    },
};
