//! A cable or hose that pulls the joint back to where it hangs loose.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Smallest stiffness of a spring \[N m/rad\].
/// Physical: far below any spring; it only keeps the rest angle finite.
const LEAST_STIFFNESS: f64 = 1e-9;

/// Effort k (q - q0), searched as k q plus a constant.
pub(super) static EFFECT: Effect = Effect {
    name: "cable_spring",
    words: Words::new(
        "Cable spring",
        "cable spring",
        "A cable or hose pulls the joint back to where it hangs freely.",
        "Joint {place}: the cables and hoses along it; does one pull or hang on something?",
        "A cable or dress pack pulls at joint {place} with {stiffness_nm_per_rad}, at rest at {rest_angle_rad}.",
    ),
    family: Family::Spring,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.0,
    parameters: &[
        Parameter::at_least("stiffness_nm_per_rad", 0.0),
        Parameter::any("rest_angle_rad"),
    ],
    coordinates: &[
        Coordinate::positive_factor("stiffness_nm_per_rad"),
        Coordinate::factor("constant_nm"),
    ],
    to_parameters: |c| {
        let stiffness = c[0].max(0.0);
        vec![stiffness, (0.0 - c[1]) / stiffness.max(LEAST_STIFFNESS)]
    },
    to_coordinates: |p| vec![p[0], -p[0] * p[1]],
    simpler: None,
    excitation: Excitation::WholeRange,
    exported: super::Exported::As(|p| {
        vec![super::Quantity::Spring {
            stiffness: p[0],
            rest: p[1],
        }]
    }),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let (reach, middle) = (draw.half_range_rad, draw.middle_rad);
        let rest = middle + draw.chance.between(-0.4, 0.4);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("stiffness_nm_per_rad", f / reach),
                ("rest_angle_rad", rest),
            ]
        })
    }),
    traits: Traits::NONE,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[stiffness, constant], j, at| {
            stiffness * at.position[j] + constant
        })
    },
};
