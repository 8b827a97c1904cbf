//! A body that the arm carries all the time.

use super::ghost::Ghost;
use super::law::array;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};
use crate::Inertia;

/// A rigid body on the tool link: the robot's dynamics are linear in its ten parameters about the link's
/// origin, so these are searched. Files hold the mass, its centre and the inertia about that. The inertia
/// is not held to be one: a motion that hardly shows it may leave it with any sign.
pub(super) static EFFECT: Effect = Effect {
    name: "payload",
    place: PlaceKind::Tool,
    layer: Layer::Body,
    parameters: &BODY_PARAMETERS,
    coordinates: &BODY_COORDINATES,
    to_parameters: |c| parameters(&array(c)).to_vec(),
    to_coordinates: |p| inertia(&array(p)).parameters().to_vec(),
    build: |site, values| {
        let inertia = Inertia::from_parameters(array(values));
        Ghost::boxed(&EFFECT, site, values, inertia, None)
    },
};

pub(super) const BODY_PARAMETERS: [Parameter; 10] = [
    Parameter::at_least("mass_kg", 0.0),
    Parameter::any("com_x_m"),
    Parameter::any("com_y_m"),
    Parameter::any("com_z_m"),
    Parameter::any("ixx_kgm2").or(0.0),
    Parameter::any("iyy_kgm2").or(0.0),
    Parameter::any("izz_kgm2").or(0.0),
    Parameter::any("ixy_kgm2").or(0.0),
    Parameter::any("ixz_kgm2").or(0.0),
    Parameter::any("iyz_kgm2").or(0.0),
];

pub(super) const BODY_COORDINATES: [Coordinate; 10] = [
    Coordinate::positive_factor("mass_kg"),
    Coordinate::factor("first_moment_x_kgm"),
    Coordinate::factor("first_moment_y_kgm"),
    Coordinate::factor("first_moment_z_kgm"),
    Coordinate::factor("origin_ixx_kgm2"),
    Coordinate::factor("origin_ixy_kgm2"),
    Coordinate::factor("origin_ixz_kgm2"),
    Coordinate::factor("origin_iyy_kgm2"),
    Coordinate::factor("origin_iyz_kgm2"),
    Coordinate::factor("origin_izz_kgm2"),
];

/// The body of [`BODY_PARAMETERS`].
pub(super) fn inertia(p: &[f64; 10]) -> Inertia {
    let [mass, x, y, z, xx, yy, zz, xy, xz, yz] = *p;
    Inertia::new(mass, [x, y, z], [xx, xy, xz, yy, yz, zz])
}

/// [`BODY_PARAMETERS`] from the ten about the origin.
pub(super) fn parameters(coordinates: &[f64; 10]) -> [f64; 10] {
    let body = Inertia::from_parameters(*coordinates);
    let [x, y, z] = body.com_m();
    let [xx, xy, xz, yy, yz, zz] = body.inertia_about_com_kgm2();
    [body.mass_kg(), x, y, z, xx, yy, zz, xy, xz, yz]
}
