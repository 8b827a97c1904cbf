//! The scale between N m and a recorded current, where nobody knows the torque constants.

use tauscope_dynamics::terms::{
    Coordinate, Effect, Layer, MotionSample, Parameter, PlaceKind, Term,
};

use crate::active::{Active, Hypothesis, Whereabouts};

/// Effort of the bodies times 1 + x: not a finding, but a number that every fit needs. Acts after all other
/// [`Layer::Body`] terms.
pub static DRIVE_GAIN: Effect = Effect {
    name: "drive_gain",
    place: PlaceKind::Joint,
    layer: Layer::Body,
    parameters: &[Parameter::any("gain")],
    coordinates: &[Coordinate::factor("gain_minus_one")],
    to_parameters: |c| vec![1.0 + c[0]],
    to_coordinates: |p| vec![p[0] - 1.0],
    build: |site, values| {
        Box::new(DriveGain {
            joint: site.joint,
            values: [values[0]],
        })
    },
};

#[derive(Debug)]
struct DriveGain {
    joint: usize,
    values: [f64; 1],
}

impl Term for DriveGain {
    fn effect(&self) -> &'static Effect {
        &DRIVE_GAIN
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] *= 1.0 + self.values[0];
    }
}

/// Whether a piece of physics is the scale of a drive.
pub fn is_drive(hypothesis: &Hypothesis) -> bool {
    hypothesis.effect.name == DRIVE_GAIN.name
}

/// The scale of each joint, 1 at first.
pub fn unknown_gains(joints: usize) -> Vec<Active> {
    let one = |joint| {
        let place = Whereabouts {
            joint,
            ..Whereabouts::default()
        };
        Hypothesis {
            effect: &DRIVE_GAIN,
            place,
        }
        .with(vec![0.0])
    };
    (0..joints).map(one).collect()
}

/// The scale of each joint in an explanation; 1 where it is none of the question.
pub fn gains(actives: &[Active], joints: usize) -> Vec<f64> {
    let mut gains = vec![1.0; joints];
    for active in actives.iter().filter(|active| is_drive(&active.hypothesis)) {
        gains[active.hypothesis.place.joint] = 1.0 + active.coordinates[0];
    }
    gains
}
