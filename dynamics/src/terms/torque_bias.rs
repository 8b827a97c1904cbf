//! A drive whose effort is reported with a constant added.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Recorded effort: the true one plus a constant.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_bias",
    place: PlaceKind::Joint,
    layer: Layer::Record,
    parameters: &[Parameter::any("bias_nm")],
    coordinates: &[Coordinate::factor("bias_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| joint_law(&EFFECT, site, values, |[bias], _, _| *bias),
};
