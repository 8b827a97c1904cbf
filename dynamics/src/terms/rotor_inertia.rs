//! The rotor's inertia, felt through the gear.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Effort J qdd, J on the joint side of the gear (Siciliano et al., *Robotics*, 2009, equation 7.77, its
/// gyroscopic part left out).
pub(super) static EFFECT: Effect = Effect {
    name: "rotor_inertia",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[Parameter::at_least("inertia_kgm2", 0.0)],
    coordinates: &[Coordinate::positive_factor("inertia_kgm2")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[inertia], j, at| {
            inertia * at.acceleration[j]
        })
    },
};
