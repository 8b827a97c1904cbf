//! A joint whose transmission also feels another joint's effort, as in wrists.

use super::law::array;
use super::{Coordinate, Effect, Layer, MotionSample, Parameter, PlaceKind, Term};

/// Recorded effort: τ + c τ of the driving joint, as it is before this term.
pub(super) static EFFECT: Effect = Effect {
    name: "transmission_coupling",
    place: PlaceKind::TwoJoints,
    layer: Layer::Record,
    parameters: &[Parameter::any("coefficient")],
    coordinates: &[Coordinate::factor("coefficient")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    build: |site, values| {
        Box::new(TransmissionCoupling {
            joint: site.joint,
            source: site.source,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct TransmissionCoupling {
    joint: usize,
    source: usize,
    values: [f64; 1],
}

impl Term for TransmissionCoupling {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] += self.values[0] * effort[self.source];
    }
}
