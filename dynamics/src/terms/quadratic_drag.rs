//! Friction in proportion to the square of the speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Effort c qd |qd|.
pub(super) static EFFECT: Effect = Effect {
    name: "quadratic_drag",
    words: Words::new(
        "Quadratic drag",
        "quadratic drag",
        "Resistance that grows with the square of the speed: fast gears in oil.",
        "Joint {place}: oil or grease of the gear; too much of it, or too stiff?",
        "Joint {place} has a drag of {drag_nms2_per_rad2} that the twin leaves out.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.0,
    parameters: &[Parameter::at_least("drag_nms2_per_rad2", 0.0)],
    coordinates: &[Coordinate::positive_factor("drag_nms2_per_rad2")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No(
        "no attribute is written for drag that grows with the square of the speed; fit viscous friction instead: --without quadratic_drag",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let fastest = draw.fastest_rad_s;
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![("drag_nms2_per_rad2", f / (fastest * fastest))]
        })
    }),
    traits: Traits {
        smallest_told_as: Some("drag_nms2_per_rad2"),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[c], j, at| {
            c * at.velocity[j] * at.velocity[j].abs()
        })
    },
};
