//! A drive with a dead zone around zero torque, like a bridge without dead-time compensation (G. Tao and P. V.
//! Kokotović, *Adaptive Control of Systems with Actuator and Sensor Nonlinearities*, 1996, chapter 2: dead zone).

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Term, Traits, Words,
};

/// Share of the band over which its edge is rounded: ripple and noise of the current dither it, and a fit needs a
/// finite slope.
/// Chosen: it leaves a slope of 1 / 0.25 = 4 at most; a wider rounding would resemble a gain.
const ROUNDED: f64 = 0.25;

/// Narrowest band \[N m or N\].
/// Resolution: keeps a quotient finite; far below any effort.
const NARROWEST: f64 = 1e-12;

/// Recorded effort: τ + d sgn(τ), because the drive delivers τ and loses d. Unlike friction it changes its sign with
/// the effort, not with the motion.
pub(super) static EFFECT: Effect = Effect {
    name: "drive_deadband",
    words: Words::new(
        "Dead band of the drive",
        "a dead band of the drive",
        "The drive loses a part of what is asked of it, whichever way it pushes: small torques do nothing.",
        "Joint {place}: the drive's dead-time compensation, the offset of its current loop, and its motor cable.",
        "The drive of joint {place} loses {deadband_nm} of whatever is asked of it: torques below that do nothing.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[Parameter::at_least("deadband_nm", 0.0)],
    coordinates: &[Coordinate::shape(
        "deadband_nm",
        0.01,
        0.4,
        6,
        Scale::OfEffort,
    )],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(
        "no attribute has a drive that answers small commands with nothing",
    ),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let largest = draw.largest_nm.max(1e-3);
        Drawn::new([1e-3, 0.4], move |share| {
            vec![("deadband_nm", share * largest)]
        })
    }),
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(DriveDeadband {
            joint: site.joint,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct DriveDeadband {
    joint: usize,
    values: [f64; 1],
}

impl Term for DriveDeadband {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        let lost = self.values[0];
        if lost.abs() > NARROWEST {
            let effort = &mut effort[self.joint];
            *effort += lost * (*effort / (ROUNDED * lost.abs())).tanh();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn it_costs_as_much_either_way_whatever_the_motion() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[0.5]);
        for (delivered, asked) in [(3.0, 3.5), (-7.0, -7.5), (0.0, 0.0)] {
            for velocity in [-1.0, 1.0] {
                let mut effort = [delivered, 9.0];
                let at = sample(0.0, 0.0, [0.0; 2], [velocity, 0.0], [0.0; 2]);
                term.act(&at.view(), &mut effort);
                assert!((effort[0] - asked).abs() < 1e-9 && effort[1] == 9.0);
            }
        }
    }
}
