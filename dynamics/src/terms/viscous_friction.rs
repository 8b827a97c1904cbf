//! Friction in proportion to speed.

use super::law::joint_law;
use super::{Coordinate, Effect, Layer, Parameter, PlaceKind};

/// Effort Fv qd (Siciliano et al., *Robotics*, 2009, equation 7.42).
pub(super) static EFFECT: Effect = Effect {
    name: "viscous_friction",
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    parameters: &[Parameter::at_least("viscous_nms_per_rad", 0.0)],
    coordinates: &[Coordinate::positive_factor("viscous_nms_per_rad")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| joint_law(&EFFECT, site, values, |[fv], j, at| fv * at.velocity[j]),
};
