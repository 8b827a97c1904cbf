//! Effort that varies periodically with the joint's angle: cogging, gear teeth, eccentric gears.

use std::f64::consts::PI;

use super::law::joint_law;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simulated,
    Traits, Words,
};

/// Effort -A sin(n q + φ), searched as the factors of sin n q and cos n q. Each of several waves is a separate term.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_ripple",
    words: Words::new(
        "Torque ripple",
        "torque ripple",
        "A wave in the torque that repeats with each turn of motor or gear.",
        "Joint {place}: gear and motor; is a tooth, a bearing or a sensor's disc worn or off centre?",
        "The effort of joint {place} ripples by {amplitude_nm}, {cycles_per_rev:ratio} times a revolution.",
    ),
    family: Family::Spring,
    place: PlaceKind::Joint,
    layer: Layer::Joint,
    odds_nats: -4.5,
    parameters: &[
        Parameter::at_least("amplitude_nm", 0.0),
        Parameter::at_least("cycles_per_rev", 0.0),
        Parameter::any("phase_rad"),
    ],
    coordinates: &[
        Coordinate::factor("sine_nm"),
        Coordinate::factor("cosine_nm"),
        Coordinate::shape("cycles_per_rev", 1.0, 64.0, 64, Scale::Waves),
    ],
    to_parameters: |c| {
        let (sine, cosine) = (0.0 - c[0], 0.0 - c[1]);
        vec![sine.hypot(cosine), c[2], cosine.atan2(sine)]
    },
    to_coordinates: |p| {
        let (sin, cos) = p[2].sin_cos();
        vec![-p[0] * cos, -p[0] * sin, p[1]]
    },
    simpler: None,
    excitation: Excitation::WholeRange,
    exported: super::Exported::No(
        "no attribute is written for a torque that ripples with the angle; it hardly moves an arm",
    ),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let cycles = f64::from(draw.chance.whole(4, 24));
        let phase = draw.chance.between(-PI, PI);
        Drawn::new(draw.efforts_nm(), move |f| {
            vec![
                ("amplitude_nm", f),
                ("cycles_per_rev", cycles),
                ("phase_rad", phase),
            ]
        })
    }),
    traits: Traits {
        most_at_one_place: 2,
        second: &["amplitude2_nm", "cycles_per_rev2", "phase2_rad"],
        ..Traits::NONE
    },
    build: |site, values| {
        joint_law(&EFFECT, site, values, |[sine, cosine, cycles], j, at| {
            let (sin, cos) = (cycles * at.position[j]).sin_cos();
            sine * sin + cosine * cos
        })
    },
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, push};
    use super::*;

    #[test]
    fn a_wave_over_the_angle() {
        let robot = TwoJoints::new();
        let coordinates = (EFFECT.to_coordinates)(&[1.5, 20.0, -0.6]);
        let mut term = (EFFECT.build)(&robot.site(), &coordinates);
        let q = 0.37_f64;
        let effort = push(&mut *term, [q, 9.0], [0.0; 2], [0.0; 2]);
        assert!((effort[0] + 1.5 * (20.0 * q - 0.6).sin()).abs() < 1e-12);
    }
}
