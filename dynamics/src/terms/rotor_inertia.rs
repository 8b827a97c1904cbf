//! Rotor inertia, reflected to the joint side of the gear.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words,
};

/// Effort J qdd, with J reflected to the joint side of the gear (Siciliano et al., *Robotics*, 2009, equation 7.77,
/// without its gyroscopic part).
pub(super) static EFFECT: Effect = Effect {
    name: "rotor_inertia",
    words: Words::new(
        "Rotor inertia",
        "rotor inertia",
        "Inertia of motor and gear, reflected to the joint, that acts only while the joint accelerates.",
        "",
        "Joint {place} has a rotor inertia (armature) of {inertia_kgm2} that the twin does not model.",
    ),
    family: Family::Transmission,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -0.7,
    parameters: &[Parameter::at_least("inertia_kgm2", 0.0)],
    coordinates: &[Coordinate::positive_factor("inertia_kgm2")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Fast,
    exported: super::Exported::As(|p| vec![super::Quantity::Armature(p[0])]),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        // The inertia that needs the drawn effort at the largest acceleration.
        let most = draw.largest_acceleration_rad_s2;
        Drawn::new(draw.efforts_nm(), move |f| vec![("inertia_kgm2", f / most)])
    }),
    traits: Traits {
        may_be_overstated: true,
        smallest_told_as: Some("inertia_kgm2"),
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[inertia], j, at| {
            inertia * at.acceleration[j]
        })
    },
};
