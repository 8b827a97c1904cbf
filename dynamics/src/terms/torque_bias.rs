//! A drive whose effort is reported with a constant added.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Recorded effort: the true one plus a constant.
pub static EFFECT: Effect = Effect {
    name: "torque_bias",
    words: Words::new(
        "Torque offset",
        "torque bias",
        "The torque is reported with a constant offset: a sensor that was not zeroed.",
        "Joint {place}: zero its torque sensor or current offset.",
        "The effort of joint {place} is recorded with an offset of {bias_nm}.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -3.0,
    parameters: &[Parameter::any("bias_nm")],
    coordinates: &[Coordinate::factor("bias_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::WholeRange,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let sign = draw.sign;
        Drawn::new(draw.efforts_nm(), move |f| vec![("bias_nm", sign * f)])
    }),
    traits: Traits {
        only_adds: true,
        is_followed: true,
        smallest_told_as: Some("bias_nm"),
        ..Traits::NONE
    },
    build: |site, values| joint_law(&EFFECT, site, values, |[bias], _, _| *bias),
};
