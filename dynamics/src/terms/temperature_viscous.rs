//! Viscous friction that falls as the joint warms up.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind, Scale};

/// Effort (Fw + Fx exp(-t/T)) qd, t since the start of the recording: the joint is cold then. No gearbox warms up at
/// once: T is searched from 3 s on.
pub(super) static EFFECT: Effect = Effect {
    name: "temperature_viscous",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("viscous_warm_nms_per_rad", 0.0),
        Parameter::at_least("viscous_extra_cold_nms_per_rad", 0.0),
        Parameter::at_least("time_constant_s", 1e-3),
    ],
    coordinates: &[
        Coordinate::positive_factor("viscous_warm_nms_per_rad"),
        Coordinate::positive_factor("viscous_extra_cold_nms_per_rad"),
        Coordinate::shape("time_constant_s", 3.0, 900.0, 18, Scale::Log),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[warm, extra, time_s], j, at| {
            (warm + extra * (-at.recording_s / time_s).exp()) * at.velocity[j]
        })
    },
};
