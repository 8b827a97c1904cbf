//! A link whose body differs from its URDF in all inertial parameters.

use super::ghost::{Ghost, While};
use super::law::array;
use super::{
    Coordinate, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits, Words,
};
use crate::Inertia;

/// Change of all ten inertial parameters of a link about the origin of its frame, in the order of
/// [`Inertia::parameters`]: for a body that differs by more than its mass or its centre of mass.
pub(super) static EFFECT: Effect = Effect {
    name: "link_inertia",
    words: Words {
        without_numbers: Some(
            "The body of link {place} differs from its URDF in several ways. The recordings do not determine all of its numbers.",
        ),
        ..Words::new(
            "Link inertia",
            "link inertia",
            "A link differs from its model in mass, centre of mass and inertia together.",
            "Link {place}: what is mounted on it or missing from it, against the URDF?",
            "Link {place} differs from its URDF in several inertial parameters: its mass by {delta_mass_kg}, its first moment (mass times centre) by ({delta_first_moment_x_kgm:number}, {delta_first_moment_y_kgm:number}, {delta_first_moment_z_kgm:number}) kg m, and its inertia as well. The effort of this difference depends on the motion of all joints that carry the link.",
        )
    },
    family: Family::Body,
    place: PlaceKind::Link,
    layer: Layer::Body,
    odds_nats: -4.0,
    parameters: &[
        Parameter::any("delta_mass_kg"),
        Parameter::any("delta_first_moment_x_kgm"),
        Parameter::any("delta_first_moment_y_kgm"),
        Parameter::any("delta_first_moment_z_kgm"),
        Parameter::any("delta_origin_ixx_kgm2"),
        Parameter::any("delta_origin_ixy_kgm2"),
        Parameter::any("delta_origin_ixz_kgm2"),
        Parameter::any("delta_origin_iyy_kgm2"),
        Parameter::any("delta_origin_iyz_kgm2"),
        Parameter::any("delta_origin_izz_kgm2"),
    ],
    coordinates: &[
        Coordinate::factor("delta_mass_kg"),
        Coordinate::factor("delta_first_moment_x_kgm"),
        Coordinate::factor("delta_first_moment_y_kgm"),
        Coordinate::factor("delta_first_moment_z_kgm"),
        Coordinate::factor("delta_origin_ixx_kgm2"),
        Coordinate::factor("delta_origin_ixy_kgm2"),
        Coordinate::factor("delta_origin_ixz_kgm2"),
        Coordinate::factor("delta_origin_iyy_kgm2"),
        Coordinate::factor("delta_origin_iyz_kgm2"),
        Coordinate::factor("delta_origin_izz_kgm2"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Body]),
    simulated: Simulated::Model,
    concealed: None,
    traits: Traits {
        describes_only: true,
        ..Traits::NONE
    },
    build: |site, values| {
        let inertia = Inertia::from_parameters(array(values));
        Ghost::boxed(&EFFECT, site, values, inertia, While::Always)
    },
};
