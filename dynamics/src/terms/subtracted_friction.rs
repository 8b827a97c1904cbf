//! Friction compensation that a controller subtracts from the effort before publishing it, and that is too large.

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Simulated, Traits,
    Words, sign,
};

/// Effort -F sgn(qd): the overcompensation seems to drive the joint, which real friction never does.
pub(super) static EFFECT: Effect = Effect {
    name: "subtracted_friction",
    words: Words::new(
        "Friction subtracted twice",
        "friction that was subtracted from the effort",
        "The effort falls short in the direction of motion: a model of the friction was taken off it that is larger than the friction.",
        "Joint {place}: does the controller publish its effort less a friction model, or is friction compensated in the driver as well?",
        "The recorded effort of joint {place} has {subtracted_nm} more Coulomb friction subtracted than the joint has.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[Parameter::at_least("subtracted_nm", 0.0)],
    coordinates: &[Coordinate::positive_factor("subtracted_nm")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| Drawn::new(draw.efforts_nm(), |f| vec![("subtracted_nm", f)])),
    traits: Traits {
        only_adds: true,
        negates_friction: true,
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[subtracted], j, at| {
            -subtracted * sign(at.velocity[j])
        })
    },
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn it_helps_the_motion_where_friction_would_resist_it() {
        let robot = TwoJoints::new();
        let mut subtracted = (EFFECT.build)(&robot.site(), &[0.5]);
        let mut friction = (super::super::coulomb_friction::EFFECT.build)(&robot.site(), &[0.5]);
        for velocity in [-1.0, 0.0, 0.3] {
            let at = sample(0.0, 0.0, [0.0; 2], [velocity, 0.0], [0.0; 2]);
            let mut effort = [3.0, 9.0];
            subtracted.act(&at.view(), &mut effort);
            assert!((3.0 - effort[0]) * velocity >= 0.0);
            // The two terms cancel.
            friction.act(&at.view(), &mut effort);
            assert!((effort[0] - 3.0).abs() < 1e-12 && effort[1] == 9.0);
        }
    }
}
