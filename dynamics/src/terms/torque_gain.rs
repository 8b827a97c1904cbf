//! A drive whose effort is reported too large or too small by a factor.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simulated, Term, Traits, Words,
};

/// Recorded effort: gain times the true one.
pub static EFFECT: Effect = Effect {
    name: "torque_gain",
    words: Words {
        nothing: Some(
            "The effort of joint {place} does not follow what the joint bears, {gain} of it: its brake holds it, its drive is off, \
             or nothing is measured there.",
        ),
        ..Words::new(
            "Torque gain",
            "torque gain",
            "The torque is reported too large or too small by a factor: sensor gain, torque constant, gear efficiency.",
            "Joint {place}: torque constant, gear ratio and the scale of its torque sensor.",
            "The effort of joint {place} is recorded {gain} times as large as it is.",
        )
    },
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -3.0,
    parameters: &[Parameter::ratio("gain", f64::NEG_INFINITY)],
    coordinates: &[Coordinate::factor("gain_excess")],
    to_parameters: |c| vec![1.0 + c[0]],
    to_coordinates: |p| vec![p[0] - 1.0],
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let sign = draw.sign;
        Drawn::new([1e-4, 0.5], move |more| vec![("gain", 1.0 + sign * more)])
    }),
    traits: Traits {
        is_scale: true,
        smallest_told_as: Some("gain_minus_one"),
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(TorqueGain {
            joint: site.joint,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct TorqueGain {
    joint: usize,
    /// Gain minus 1.
    values: [f64; 1],
}

impl Term for TorqueGain {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] *= 1.0 + self.values[0];
    }
}
