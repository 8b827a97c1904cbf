//! A body that the arm carries permanently.

use super::ghost::{Ghost, While};
use super::law::array;
use super::{
    Coordinate, Draw, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated,
    Traits, Words,
};
use crate::Inertia;

/// A rigid body on the tool link. The robot's dynamics are linear in its ten parameters about the link's origin, so
/// these are searched. Files hold the mass, its centre and the inertia about that centre. The inertia is not
/// constrained to be physical: if the motion hardly excites it, its sign is arbitrary.
pub static EFFECT: Effect = Effect {
    name: "payload",
    words: Words::new(
        "Payload",
        "a payload",
        "Something is mounted on or held by the tool that the twin does not know of.",
        "The tool: what is mounted on it or held by it that the URDF does not have?",
        "The arm carries an undeclared payload of {mass_kg}.",
    ),
    family: Family::Body,
    place: PlaceKind::Tool,
    layer: Layer::Body,
    odds_nats: -2.5,
    parameters: &BODY_PARAMETERS,
    coordinates: &BODY_COORDINATES,
    to_parameters: |c| parameters(&array(c)).to_vec(),
    to_coordinates: |p| inertia(&array(p)).parameters().to_vec(),
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::As(|_| vec![super::Quantity::Body]),
    simulated: Simulated::Model,
    concealed: Some(|draw| drawn(draw, None)),
    traits: Traits {
        is_followed: true,
        smallest_told_as: Some("mass_kg"),
        ..Traits::NONE
    },
    build: |site, values| {
        let inertia = Inertia::from_parameters(array(values));
        Ghost::boxed(&EFFECT, site, values, inertia, While::Always)
    },
};

/// Radius of gyration of a drawn body \[m\].
/// Chosen: for simulated cells only; that of a compact body of about 10 cm, such as a gripper.
const DRAWN_RADIUS_M: f64 = 0.04;

/// Draws a random body. If it is temporary, its start and end are drawn from these ranges, as shares of the shortest
/// recording.
pub(super) fn drawn(draw: &mut Draw<'_>, window: Option<[[f64; 2]; 2]>) -> Option<Drawn> {
    let com_m = [[-0.04, 0.04], [-0.04, 0.04], [0.03, 0.12]]
        .map(|[least, most]| draw.chance.between(least, most));
    let shortest_s = draw.shortest_s;
    let window = window
        .map(|shares| shares.map(|[least, most]| shortest_s * draw.chance.between(least, most)));
    Drawn::new([1e-3, 10.0], move |mass| {
        let inertia = mass * DRAWN_RADIUS_M * DRAWN_RADIUS_M;
        let mut all = vec![
            ("mass_kg", mass),
            ("com_x_m", com_m[0]),
            ("com_y_m", com_m[1]),
            ("com_z_m", com_m[2]),
            ("ixx_kgm2", inertia),
            ("iyy_kgm2", inertia),
            ("izz_kgm2", inertia),
        ];
        if let Some([start, end]) = window {
            all.extend([("t_start_s", start), ("t_end_s", end)]);
        }
        all
    })
}

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

/// [`BODY_PARAMETERS`] from the ten parameters about the origin.
pub(super) fn parameters(coordinates: &[f64; 10]) -> [f64; 10] {
    let body = Inertia::from_parameters(*coordinates);
    let [x, y, z] = body.com_m();
    let [xx, xy, xz, yy, yz, zz] = body.inertia_about_com_kgm2();
    [body.mass_kg(), x, y, z, xx, yy, zz, xy, xz, yz]
}
