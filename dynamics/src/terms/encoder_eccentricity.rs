//! An encoder off centre: its error repeats once or twice per revolution. B. W. Mooring, Z. S. Roth and M. R. Driels,
//! *Fundamentals of Manipulator Calibration*, 1991, list it among the non-geometric errors of a joint.

use std::f64::consts::PI;
use std::sync::Arc;

use super::displaced::Displaced;
use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Term, Traits, Words, wave,
};

/// The true motion of the joint is the recorded position q plus A sin(n q + φ) and its derivatives. The effort of
/// this effect is that of the true motion minus that of the recorded motion. To first order linear in the factors of
/// sin n q and cos n q.
pub(super) static EFFECT: Effect = Effect {
    name: "encoder_eccentricity",
    words: Words::new(
        "Encoder off centre",
        "an encoder off centre",
        "The recorded position is off by an error that comes and goes once or twice per revolution: an encoder disc or ring off \
         its axis, or a gear with a kinematic error.",
        "Joint {place}: is its encoder disc or ring mounted off centre, loose or dirty at one side?",
        "The recorded position of joint {place} is off by up to {amplitude_rad} either way, {cycles_per_rev:ratio} times per \
         revolution.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("amplitude_rad", 0.0),
        Parameter::at_least("cycles_per_rev", 0.0),
        Parameter::any("phase_rad"),
    ],
    coordinates: &[
        Coordinate::bending_factor("sine_rad"),
        Coordinate::bending_factor("cosine_rad"),
        Coordinate::shape("cycles_per_rev", 1.0, 2.0, 2, Scale::Linear),
    ],
    to_parameters: wave::to_parameters,
    to_coordinates: wave::to_coordinates,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Joint,
    concealed: Some(|draw| {
        let cycles = f64::from(draw.chance.whole(1, 2));
        let phase = draw.chance.between(-PI, PI);
        Drawn::new([1e-3, 0.1], move |size| {
            vec![
                ("amplitude_rad", size),
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
        Box::new(EncoderEccentricity {
            joint: site.joint,
            values: array(values),
            robot: Displaced::new(site.model, site.joint),
        })
    },
};

#[derive(Debug)]
struct EncoderEccentricity {
    joint: usize,
    /// Factors of sine and cosine \[rad\], and cycles per revolution.
    values: [f64; 3],
    robot: Displaced,
}

impl EncoderEccentricity {
    /// True position, velocity and acceleration of the joint.
    fn truly(&self, at: &MotionSample<'_>) -> [f64; 3] {
        let j = self.joint;
        let [sine, cosine, n] = self.values;
        let (q, qd, qdd) = (at.position[j], at.velocity[j], at.acceleration[j]);
        let (sin, cos) = (n * q).sin_cos();
        let error = sine * sin + cosine * cos;
        let slope = n * (sine * cos - cosine * sin);
        let bend = -n * n * error;
        [
            q + error,
            qd * (1.0 + slope),
            qdd * (1.0 + slope) + bend * qd * qd,
        ]
    }
}

impl Term for EncoderEccentricity {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        if self.values[0] == 0.0 && self.values[1] == 0.0 {
            return;
        }
        self.robot.act(at, self.truly(at), effort);
    }

    fn know_recorded(&mut self, efforts: &Arc<Vec<f64>>) {
        self.robot.know_recorded(efforts);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, motion, run};
    use super::*;
    use crate::{Data, rnea};

    #[test]
    fn the_robot_is_where_the_encoder_does_not_say() {
        let robot = TwoJoints::new();
        let motion = motion(&robot.model, 50);
        let mut data = Data::new(&robot.model);
        let mut term = (EFFECT.build)(&robot.site(), &[0.02, -0.01, 1.0]);
        let off = |q: f64| 0.02 * q.sin() - 0.01 * q.cos();
        for (at, added) in motion.iter().zip(run(&mut *term, &motion)) {
            // The recorded motion over a short time; the true motion is differentiated numerically.
            let path = |t: f64| {
                let q = at.position[0] + at.velocity[0] * t + 0.5 * at.acceleration[0] * t * t;
                q + off(q)
            };
            let step = 1e-4;
            let (before, now, after) = (path(-step), path(0.0), path(step));
            let (mut q, mut qd, mut qdd) = (at.position, at.velocity, at.acceleration);
            q[0] = now;
            qd[0] = (after - before) / (2.0 * step);
            qdd[0] = (after - 2.0 * now + before) / (step * step);
            let there = rnea(&robot.model, &mut data, &q, &qd, &qdd).to_vec();
            for j in 0..2 {
                let expected = there[j] - at.transmitted[j];
                assert!(
                    (added[j] - expected).abs() < 1e-3,
                    "{} {expected}",
                    added[j]
                );
            }
        }
    }
}
