//! An effort whose zero jumps once: a torque sensor that is zeroed again, a current sensor whose offset shifts.

use super::law::joint_law;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler,
    Simulated, Traits, Words,
};

/// Recorded effort: the true one plus one constant before a time of the session and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "bias_step",
    words: Words::new(
        "Torque offset that jumped",
        "a torque offset that jumped once",
        "From some time on the effort is reported with another offset: a sensor that was zeroed anew, or whose zero moved.",
        "Joint {place}: was its sensor zeroed then, under load perhaps? Else its amplifier, plug and mount.",
        "The offset of the effort of joint {place} jumped from {bias_before_nm} to {bias_after_nm}, {change_time_session_s} \
         into the session.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[
        Parameter::any("bias_before_nm"),
        Parameter::any("bias_after_nm"),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::factor("bias_before_nm"),
        Coordinate::factor("bias_after_nm"),
        time("change_time_session_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::torque_bias::EFFECT,
        numbers: &["bias_after_nm", "bias_before_nm"],
    }),
    excitation: Excitation::WholeRange,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: None,
    traits: Traits {
        is_off_list: true,
        only_adds: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[before, after, time_s], _, at| {
            at.stepped([*before, *after], *time_s)
        })
    },
};
