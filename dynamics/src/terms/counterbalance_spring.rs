//! A spring that turns with the joint like a weight, to carry the arm.

use std::f64::consts::PI;

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Effort A sin(q - q0), searched as A cos q0 sin q - A sin q0 cos q.
pub(super) static EFFECT: Effect = Effect {
    name: "counterbalance_spring",
    words: Words::new(
        "Counterbalance spring",
        "counterbalance spring",
        "A spring or gas strut carries part of the weight.",
        "Joint {place}: spring or gas strut that carries weight; is there one that the URDF does not have?",
        "A counterbalance of {amplitude_nm} acts on joint {place}, at rest at {rest_angle_rad}.",
    ),
    family: Family::Spring,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.0,
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
    simpler: None,
    excitation: Excitation::WholeRange,
    exported: super::Exported::No(
        "no attribute has a spring by the sine of the angle; model it as a body on a lever, or as a spring between two bodies",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let rest = draw.chance.between(-PI, PI);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![("amplitude_nm", f), ("rest_angle_rad", rest)]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[sine, cosine], j, at| {
            let (sin, cos) = at.position[j].sin_cos();
            sine * sin + cosine * cos
        })
    },
};
