//! Coulomb friction that jumps once.

use super::law::joint_law;
use super::{Coordinate, CoordinateKind, Effect, Layer, Parameter, PlaceKind, sign};

/// Effort F sgn(qd), F being one value before a time of the session and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "friction_step",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[
        Parameter::at_least("coulomb_before_nm", 0.0),
        Parameter::at_least("coulomb_after_nm", 0.0),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::positive_factor("coulomb_before_nm"),
        Coordinate::positive_factor("coulomb_after_nm"),
        Coordinate {
            name: "change_time_session_s",
            kind: CoordinateKind::SessionTime,
        },
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[before, after, time_s], j, at| {
            let coulomb = if at.session_s < *time_s {
                before
            } else {
                after
            };
            coulomb * sign(at.velocity[j])
        })
    },
};
