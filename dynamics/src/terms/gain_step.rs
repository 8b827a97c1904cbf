//! A torque constant or a sensor's scale that jumps once: a burnt winding, overheated magnets, a drive that was
//! reconfigured.

use super::law::array;
use super::payload_pickup::time;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simpler, Simulated, Term, Traits, Words,
};

/// Recorded effort: one gain times the true one before a time of the session, and another from then on.
pub(super) static EFFECT: Effect = Effect {
    name: "gain_step",
    words: Words::new(
        "Gain that jumped",
        "a torque gain that jumped once",
        "From some time on the torque is reported larger or smaller by a factor: a motor that lost a part of its magnets or \
         windings, a drive or a sensor that was set up anew.",
        "Joint {place}: what was set in its drive or sensor then? Was its motor too hot?",
        "The effort of joint {place} is recorded too large by a share of {gain_excess_before} up to {change_time_session_s} of \
         the session, and by {gain_excess_after} since.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[
        Parameter::ratio("gain_excess_before", f64::NEG_INFINITY),
        Parameter::ratio("gain_excess_after", f64::NEG_INFINITY),
        Parameter::any("change_time_session_s"),
    ],
    coordinates: &[
        Coordinate::factor("gain_excess_before"),
        Coordinate::factor("gain_excess_after"),
        time("change_time_session_s", CoordinateKind::SessionTime),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::torque_gain::EFFECT,
        numbers: &["gain_excess_after", "gain_excess_before"],
    }),
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: None,
    traits: Traits {
        is_off_list: true,
        is_scale: true,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(GainStep {
            joint: site.joint,
            values: array(values),
        })
    },
};

#[derive(Debug)]
struct GainStep {
    joint: usize,
    /// Gain before and after the jump, minus 1, and time of the jump \[s from the start of the session\].
    values: [f64; 3],
}

impl Term for GainStep {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let [before, after, time_s] = self.values;
        effort[self.joint] *= 1.0 + at.stepped([before, after], time_s);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn the_gain_jumps_in_the_session() {
        let robot = TwoJoints::new();
        let effort_at = |jumps_s: f64| {
            let mut term = (EFFECT.build)(&robot.site(), &[0.1, 0.5, jumps_s]);
            // The session began 150 s before.
            let at = sample(0.0, 50.0, [0.0; 2], [0.0; 2], [0.0; 2]);
            let mut effort = [10.0, 7.0];
            term.act(&at.view(), &mut effort);
            assert!(effort[1] == 7.0);
            effort[0]
        };
        assert!((effort_at(1e3) - 11.0).abs() < 1e-12);
        assert!((effort_at(10.0) - 15.0).abs() < 1e-12);
    }
}
