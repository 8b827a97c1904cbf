//! A drive whose effort is reported too large or too small by a factor.

use super::law::array;
use super::{Coordinate, Effect, Layer, MotionSample, Parameter, PlaceKind, Term};

/// Recorded effort: gain times the true one.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_gain",
    place: PlaceKind::Joint,
    layer: Layer::Record,
    parameters: &[Parameter::any("gain")],
    coordinates: &[Coordinate::factor("gain_excess")],
    to_parameters: |c| vec![1.0 + c[0]],
    to_coordinates: |p| vec![p[0] - 1.0],
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
    /// Gain less 1.
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
