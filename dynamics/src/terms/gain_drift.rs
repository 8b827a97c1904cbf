//! A torque constant that changes steadily through a session: magnets lose about 0.1 % of their field per kelvin (`NdFeB`; J. R.
//! Hendershot and T. J. E. Miller, *Design of Brushless Permanent-Magnet Machines*, 2010), so a motor that warms up needs more
//! current for the same torque.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Simpler, Simulated, Term, Traits, Words,
};

/// Recorded effort: 1 + g + r t times the true one, t being the time since the start of the session.
pub(super) static EFFECT: Effect = Effect {
    name: "gain_drift",
    words: Words::new(
        "Gain that drifts",
        "a gain that changes steadily",
        "The torque is reported larger or smaller the longer the session lasts: a motor whose magnets warm up, a sensor or an \
         amplifier that drifts.",
        "Joint {place}: is its motor hot? Does its torque sensor or amplifier drift? Record again when all is warm.",
        "The effort of joint {place} is recorded too large by a share that is {gain_excess_start} at the start of the session \
         and changes by {growth_per_s}. The corrected twin has the gain at the end of the recordings.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[
        Parameter::ratio("gain_excess_start", f64::NEG_INFINITY),
        Parameter::any("growth_per_s"),
    ],
    coordinates: &[
        Coordinate::factor("gain_excess_start"),
        Coordinate::factor("growth_per_s"),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: Some(Simpler {
        effect: &super::torque_gain::EFFECT,
        numbers: &["gain_excess_start"],
    }),
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let (sign, end_s) = (draw.sign, draw.start_session_s + draw.shortest_s);
        Drawn::new([1e-3, 0.2], move |more| {
            vec![
                ("gain_excess_start", 0.0),
                ("growth_per_s", sign * more / end_s),
            ]
        })
    }),
    traits: Traits {
        is_off_list: true,
        is_scale: true,
        drifts: Some(at_session),
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(GainDrift {
            joint: site.joint,
            values: array(values),
        })
    },
};

/// The gain at a time of the session.
fn at_session(coordinates: &[f64], session_s: f64) -> f64 {
    let [start, growth] = array(coordinates);
    1.0 + start + growth * session_s
}

#[derive(Debug)]
struct GainDrift {
    joint: usize,
    /// Gain at the start of the session, minus 1, and its growth \[1/s\].
    values: [f64; 2],
}

impl Term for GainDrift {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        effort[self.joint] *= at_session(&self.values, at.session_s);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn the_gain_grows_with_the_session() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[0.1, 0.001]);
        // The session began 100 s before.
        let at = sample(0.0, 50.0, [0.0; 2], [0.0; 2], [0.0; 2]);
        let mut effort = [10.0, 7.0];
        term.act(&at.view(), &mut effort);
        assert!((effort[0] - 12.5).abs() < 1e-12 && effort[1] == 7.0);
    }
}
