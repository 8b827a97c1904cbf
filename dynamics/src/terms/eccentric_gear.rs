//! Friction that varies periodically with the angle: a gear or bearing off centre, a bent shaft, a seal that rubs at
//! one side (B. Armstrong-Hélouvry, *Control of Machines with Friction*, 1991, position-dependent friction).

use std::f64::consts::PI;

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simulated,
    Traits, Words, sign, wave,
};

/// Effort A sin(n q + φ) sgn(qd), searched as the factors of sin n q and cos n q. It comes on top of Coulomb friction.
pub(super) static EFFECT: Effect = Effect {
    name: "eccentric_gear",
    words: Words::new(
        "Friction that varies with the angle",
        "friction that varies with the angle",
        "Dry friction that is larger at one side of a turn than at the other: a gear, bearing or shaft off centre.",
        "Joint {place}: gear, bearing, seal and shaft; is one bent, worn at one side or off centre?",
        "The dry friction of joint {place} varies by {variation_nm} either way, {cycles_per_rev:ratio} times a revolution.",
    ),
    family: Family::Spring,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("variation_nm", 0.0),
        Parameter::at_least("cycles_per_rev", 0.0),
        Parameter::any("phase_rad"),
    ],
    coordinates: &[
        Coordinate::factor("sine_nm"),
        Coordinate::factor("cosine_nm"),
        Coordinate::shape("cycles_per_rev", 1.0, 24.0, 24, Scale::Waves),
    ],
    to_parameters: wave::to_parameters,
    to_coordinates: wave::to_coordinates,
    simpler: None,
    excitation: Excitation::Speeds,
    exported: super::Exported::No("no attribute has friction that depends on the angle"),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let cycles = f64::from(draw.chance.whole(1, 8));
        let phase = draw.chance.between(-PI, PI);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("variation_nm", f),
                ("cycles_per_rev", cycles),
                ("phase_rad", phase),
            ]
        })
    }),
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[sine, cosine, cycles], j, at| {
            let (sin, cos) = (cycles * at.position[j]).sin_cos();
            (sine * sin + cosine * cos) * sign(at.velocity[j])
        })
    },
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, push};
    use super::*;

    #[test]
    fn it_turns_with_the_direction_and_goes_up_and_down_with_the_angle() {
        let robot = TwoJoints::new();
        let coordinates = (EFFECT.to_coordinates)(&[1.5, 3.0, 0.4]);
        let mut term = (EFFECT.build)(&robot.site(), &coordinates);
        for (q, qd) in [(0.37_f64, 1.0), (0.37, -1.0), (1.2, 1.0)] {
            let effort = push(&mut *term, [q, 9.0], [qd, 0.0], [0.0; 2]);
            let expected = 1.5 * (3.0 * q + 0.4).sin() * qd;
            assert!((effort[0] - expected).abs() < 1e-12 && effort[1] == 0.0);
        }
    }
}
