//! Scale between N m and a recorded current where the torque constants are unknown.

use tauscope_dynamics::terms::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simulated, Term, Traits, Words,
};

use crate::physics::active::{Active, Hypothesis, TORQUE_SCALE, Whereabouts};

/// Scales the effort of the bodies by 1 + x. It is not a finding, but part of every fit. It acts after all other
/// [`Layer::Body`] terms.
/// [`Layer::Body`] terms.
pub static EFFECT: Effect = Effect {
    name: TORQUE_SCALE,
    words: Words::new(
        "Torque scale",
        "torque scale",
        "Factor between the torque in N m and the recorded effort.",
        "",
        "The effort of joint {place} is recorded {gain} times the model's.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: 0.0,
    parameters: &[Parameter::ratio("gain", 0.0)],
    // A motor's torque has the sign of its current; the opposite sign is a fault of the recording.
    coordinates: &[Coordinate {
        name: "gain_minus_one",
        kind: CoordinateKind::Factor {
            step: 1.0,
            minimum: -1.0,
        },
    }],
    to_parameters: |c| vec![1.0 + c[0]],
    to_coordinates: |p| vec![p[0] - 1.0],
    simpler: None,
    excitation: Excitation::Poses,
    exported: tauscope_dynamics::terms::Exported::No("it is the unit of the recording"),
    simulated: Simulated::Record,
    concealed: None,
    traits: Traits::NONE,
    build: |site, values| {
        Box::new(TorqueScale {
            joint: site.joint,
            values: [values[0]],
        })
    },
};

#[derive(Debug)]
struct TorqueScale {
    joint: usize,
    values: [f64; 1],
}

impl Term for TorqueScale {
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

/// Returns the unknown torque scales with their initial values.
pub fn unknown_scales(first: &[(usize, f64)]) -> Vec<Active> {
    let one = |&(joint, gain): &(usize, f64)| {
        let place = Whereabouts {
            joint,
            ..Whereabouts::default()
        };
        Hypothesis {
            effect: &EFFECT,
            place,
        }
        .with(vec![gain - 1.0])
    };
    first.iter().map(one).collect()
}

/// Returns the torque scale of each joint in an explanation; 1 where it is not fitted.
pub fn gains(actives: &[Active], joints: usize) -> Vec<f64> {
    let mut gains = vec![1.0; joints];
    for active in actives
        .iter()
        .filter(|active| active.hypothesis.is_torque_scale())
    {
        gains[active.hypothesis.place.joint] = 1.0 + active.coordinates[0];
    }
    gains
}
