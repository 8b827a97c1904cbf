//! A sensor or drive with a limited range.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Term, Traits, Words,
};

/// Recorded effort: the true one, limited to ± the limit.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_saturation",
    words: Words::new(
        "Torque saturation",
        "torque saturation",
        "The torque stops at a limit: of the sensor's range, or of the drive.",
        "Joint {place}: the range of its sensor and the limit of its drive.",
        "The recorded effort of joint {place} saturates at {limit_nm}.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -4.0,
    parameters: &[Parameter::at_least("limit_nm", 0.0)],
    coordinates: &[Coordinate::shape("limit_nm", 0.3, 1.0, 15, Scale::OfEffort)],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let largest = draw.largest_nm;
        Drawn::new([0.05, 0.7], move |cut| {
            vec![("limit_nm", largest * (1.0 - cut))]
        })
    }),
    traits: Traits {
        cuts_off: true,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(TorqueSaturation {
            joint: site.joint,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct TorqueSaturation {
    joint: usize,
    values: [f64; 1],
}

impl Term for TorqueSaturation {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        let effort = &mut effort[self.joint];
        // A negative limit, which a fit may try, limits the effort to zero.
        let limit = self.values[0].max(0.0);
        *effort = effort.clamp(-limit, limit);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn cuts_off_either_way() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[2.0]);
        for (before, after) in [(3.0, 2.0), (-7.0, -2.0), (1.5, 1.5)] {
            let mut effort = [before, 9.0];
            let at = sample(0.0, 0.0, [0.0; 2], [0.0; 2], [0.0; 2]);
            term.act(&at.view(), &mut effort);
            assert_eq!(effort, [after, 9.0]);
        }
    }
}
