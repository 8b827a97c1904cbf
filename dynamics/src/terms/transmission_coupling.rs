//! A joint whose transmission also carries another joint's effort, as in wrists.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simulated, Term, Traits, Words,
};

/// Recorded effort: τ + c τ of the driving joint, each without this term.
pub(super) static EFFECT: Effect = Effect {
    name: "transmission_coupling",
    words: Words::new(
        "Transmission coupling",
        "transmission coupling",
        "Torque of one joint shows in another: coupled gears or belts, as in a wrist.",
        "Joint {place} and joint {source}: coupled gears or belts, and the decoupling in the controller.",
        "Joint {place} carries {coefficient} times the effort of joint {source}.",
    ),
    family: Family::Transmission,
    place: PlaceKind::TwoJoints,
    layer: Layer::Record,
    odds_nats: -5.0,
    parameters: &[Parameter::ratio("coefficient", f64::NEG_INFINITY)],
    coordinates: &[Coordinate::factor("coefficient")],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(
        "no attribute has a coupling of efforts between joints; MuJoCo has fixed tendons",
    ),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let sign = draw.sign;
        let two = draw.site.source != draw.site.joint;
        two.then(|| Drawn::new([1e-4, 0.4], move |c| vec![("coefficient", sign * c)]))?
    }),
    traits: Traits::NONE,
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
