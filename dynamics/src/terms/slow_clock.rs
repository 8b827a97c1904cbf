//! Efforts with a growing delay, because their clock runs slow.

use super::delay_line::DelayLine;
use super::law::array;
use super::{
    Coordinate, CoordinateKind, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simulated, Term, Traits, Words,
};

/// Seconds per hour.
const HOUR_S: f64 = 3600.0;

/// Recorded effort: the true one of all joints with a delay that grows from the start of the session on.
pub(super) static EFFECT: Effect = Effect {
    name: "slow_clock",
    words: Words::new(
        "Slow clock of the efforts",
        "efforts that come later and later",
        "The torques are stamped by a clock that runs slow against that of the positions.",
        "The clocks of the drive and of the recorder: are they synchronised, and is a buffer of efforts filling up?",
        "The efforts are recorded with a delay that grows by {delay_per_hour_s} per hour: their clock runs slow.",
    ),
    family: Family::Recording,
    place: PlaceKind::All,
    layer: Layer::Record,
    odds_nats: -6.0,
    parameters: &[Parameter::at_least("delay_per_hour_s", 0.0)],
    coordinates: &[Coordinate {
        name: "delay_per_hour_s",
        kind: CoordinateKind::Factor {
            step: 0.01,
            minimum: 0.0,
        },
    }],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Fast,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|_| Drawn::new([0.1, 10.0], |late| vec![("delay_per_hour_s", late)])),
    traits: Traits {
        shifts_time: true,
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(SlowClock {
            values: array(values),
            line: DelayLine::new(site.model.dof(), 0.0),
        })
    },
};

#[derive(Debug)]
struct SlowClock {
    values: [f64; 1],
    line: DelayLine,
}

impl Term for SlowClock {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.line.reset();
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        self.line
            .set_delay(self.values[0] / HOUR_S * at.session_s.max(0.0));
        self.line.pass(at, effort);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn the_delay_grows_with_the_session() {
        let robot = TwoJoints::new();
        // 1 ms per second of a session that began 100 s before.
        let mut term = (EFFECT.build)(&robot.site(), &[3.6]);
        for k in 0..500 {
            let t = 0.01 * f64::from(k);
            let mut effort = [t, -t];
            let dt_s = if k == 0 { 0.0 } else { 0.01 };
            let at = sample(dt_s, t, [0.0; 2], [0.0; 2], [0.0; 2]);
            term.act(&at.view(), &mut effort);
            let then = (t - 0.1 - 0.001 * t).max(0.0);
            assert!((effort[0] - then).abs() < 1e-9, "{t}: {effort:?}, {then}");
            assert!((effort[1] + then).abs() < 1e-9);
        }
    }
}
