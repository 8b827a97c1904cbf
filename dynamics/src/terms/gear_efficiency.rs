//! A gear whose loss differs by the direction of power: P. Hamon, M. Gautier and P. Garrec, "Dynamic Identification of
//! Robots with a Dry Friction Model Depending on Load and Velocity", IROS 2010, whose friction is linear in the load with a
//! factor of its own in each quadrant of torque and speed.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simpler, Simulated,
    Traits, Words, sign,
};

/// Effort μd max(τ sgn(qd), 0) sgn(qd) while the motor drives the load, μb max(-τ sgn(qd), 0) sgn(qd) while the load
/// drives the motor; τ is the rigid body's effort without friction.
pub(super) static EFFECT: Effect = Effect {
    name: "gear_efficiency",
    words: Words::new(
        "Gear efficiency by direction of power",
        "a gear loss that differs by the direction of power",
        "The gear loses another share of the torque when it lifts than when it lets down.",
        "Joint {place}: gear and lubricant; a worm, a spindle or a worn gear drives back worse than forth.",
        "The gear of joint {place} loses {driving_coefficient:ratio} of the load when the motor drives it and \
         {backdriving_coefficient:ratio} when the load drives the motor.",
    ),
    family: Family::Friction,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[
        Parameter::ratio("driving_coefficient", 0.0),
        Parameter::ratio("backdriving_coefficient", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("driving_coefficient"),
        Coordinate::positive_factor("backdriving_coefficient"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::load_dependent_friction::EFFECT,
        numbers: &["driving_coefficient", "backdriving_coefficient"],
    }),
    excitation: Excitation::Speeds,
    exported: super::Exported::No(
        "no attribute of these targets has friction that grows with the load",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let (mut drives, mut driven) = (1.0, 0.2 + 0.3 * draw.share);
        if draw.chance.coin() {
            std::mem::swap(&mut drives, &mut driven);
        }
        Drawn::new([1e-4, 0.5], move |loss| {
            vec![
                ("driving_coefficient", loss * drives),
                ("backdriving_coefficient", loss * driven),
            ]
        })
    }),
    traits: Traits {
        needs_load: true,
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[drives, driven], j, at| {
            let direction = sign(at.velocity[j]);
            let power = at.transmitted[j] * direction;
            (drives * power.max(0.0) + driven * (-power).max(0.0)) * direction.signum()
        })
    },
};
