//! A torque constant that varies with the angle: magnets of unequal strength, a bent shaft in its stator, a torque
//! sensor whose bridge is sensitive to the angle. J. R. Hendershot and T. J. E. Miller, *Design of Brushless
//! Permanent-Magnet Machines*, 2010.

use std::f64::consts::PI;

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Term, Traits, Words, wave,
};

/// Recorded effort: 1 + A sin(n q + φ) times the true one, searched as the factors of sin n q and cos n q.
pub(super) static EFFECT: Effect = Effect {
    name: "gain_ripple",
    words: Words::new(
        "Gain that varies with the angle",
        "a gain that varies with the angle",
        "The torque is reported larger at one side of a turn than at the other: a motor with unequal magnets or a bent shaft, or \
         a torque sensor that feels the angle.",
        "Joint {place}: motor, shaft and torque sensor; is one damaged or mounted askew?",
        "The effort of joint {place} is recorded too large and too small by up to {share_of_effort}, {cycles_per_rev:ratio} times a \
         revolution.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[
        Parameter::ratio("share_of_effort", 0.0),
        Parameter::at_least("cycles_per_rev", 0.0),
        Parameter::any("phase_rad"),
    ],
    coordinates: &[
        Coordinate::factor("sine_share"),
        Coordinate::factor("cosine_share"),
        Coordinate::shape("cycles_per_rev", 1.0, 8.0, 8, Scale::Waves),
    ],
    to_parameters: wave::to_parameters,
    to_coordinates: wave::to_coordinates,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let cycles = f64::from(draw.chance.whole(1, 8));
        let phase = draw.chance.between(-PI, PI);
        Drawn::new([1e-3, 0.3], move |share| {
            vec![
                ("share_of_effort", share),
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
        Box::new(GainRipple {
            joint: site.joint,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct GainRipple {
    joint: usize,
    /// Factors of sine and cosine, and cycles per revolution.
    values: [f64; 3],
}

impl Term for GainRipple {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [sine, cosine, cycles] = self.values;
        let (sin, cos) = (cycles * at.position[self.joint]).sin_cos();
        effort[self.joint] *= 1.0 + sine * sin + cosine * cos;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn the_gain_goes_up_and_down_with_the_angle() {
        let robot = TwoJoints::new();
        let coordinates = (EFFECT.to_coordinates)(&[0.2, 3.0, 0.4]);
        let mut term = (EFFECT.build)(&robot.site(), &coordinates);
        for q in [0.37_f64, 1.2] {
            let at = sample(0.0, 0.0, [q, 9.0], [0.0; 2], [0.0; 2]);
            let mut effort = [10.0, 7.0];
            term.act(&at.view(), &mut effort);
            let expected = 10.0 * (1.0 + 0.2 * (3.0 * q + 0.4).sin());
            assert!((effort[0] - expected).abs() < 1e-12 && effort[1] == 7.0);
        }
    }
}
