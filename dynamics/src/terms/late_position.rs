//! A joint whose position is reported late: an encoder on a separate channel, read or sent less often than the
//! others.

use std::sync::Arc;

use super::displaced::Displaced;
use super::law::array;
use super::{
    Coordinate, CoordinateKind, Effect, Excitation, Family, Layer, MotionSample, Parameter,
    PlaceKind, Simulated, Site, Term, Traits, Words,
};

/// The true position of the joint is the one that is reported after the delay. It is extrapolated by the Taylor
/// series of the recorded motion up to the jerk, so motion much faster than the delay is less accurate.
pub(super) static EFFECT: Effect = Effect {
    name: "late_position",
    words: Words::new(
        "Late position channel",
        "a position channel that is late",
        "The position of one joint is reported late against the efforts, and against the other joints.",
        "Joint {place}: how its encoder is read and sent; is its channel slower, filtered or read less often than the others?",
        "The position of joint {place} is recorded {delay_s} later than those of the other joints.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Body,
    odds_nats: -7.0,
    parameters: &[Parameter::at_least("delay_s", 0.0)],
    coordinates: &[Coordinate {
        name: "delay_s",
        kind: CoordinateKind::Factor {
            step: 1e-3,
            minimum: 0.0,
        },
    }],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Fast,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::No(
        "shift the position of that joint in a simulated recording, for example in its CSV table",
    ),
    concealed: None,
    traits: Traits {
        shifts_time: true,
        is_off_list: true,
        smallest_told_as: Some("delay_s"),
        ..Traits::NONE
    },
    build: |site, values| LatePosition::boxed(site, array(values)),
};

#[derive(Debug)]
struct LatePosition {
    joint: usize,
    values: [f64; 1],
    robot: Displaced,
    /// Acceleration at the previous sample \[rad/s² or m/s²\].
    acceleration_before: Option<f64>,
    /// Newest jerk \[rad/s³ or m/s³\].
    jerk: f64,
}

impl LatePosition {
    fn boxed(site: &Site<'_>, values: [f64; 1]) -> Box<dyn Term> {
        Box::new(Self {
            joint: site.joint,
            values,
            robot: Displaced::new(site.model, site.joint),
            acceleration_before: None,
            jerk: 0.0,
        })
    }

    /// True position, velocity and acceleration of the joint.
    fn truly(&self, at: &MotionSample<'_>) -> [f64; 3] {
        let (j, [late_s]) = (self.joint, self.values);
        let (q, qd, qdd) = (at.position[j], at.velocity[j], at.acceleration[j]);
        let half = 0.5 * late_s * late_s;
        [
            q + late_s * qd + half * qdd + half * late_s / 3.0 * self.jerk,
            qd + late_s * qdd + half * self.jerk,
            qdd + late_s * self.jerk,
        ]
    }
}

impl Term for LatePosition {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.acceleration_before = None;
        self.jerk = 0.0;
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let now = at.acceleration[self.joint];
        // A repeated stamp gives no new jerk.
        if at.dt_s > 0.0
            && let Some(before) = self.acceleration_before
        {
            self.jerk = (now - before) / at.dt_s;
        }
        self.acceleration_before = Some(now);
        if self.values[0] == 0.0 {
            return;
        }
        self.robot.act(at, self.truly(at), effort);
    }

    fn know_recorded(&mut self, efforts: &Arc<Vec<f64>>) {
        self.robot.know_recorded(efforts);
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;
    use crate::{Data, rnea};

    #[test]
    fn the_robot_is_where_it_will_be_reported() {
        let robot = TwoJoints::new();
        let mut data = Data::new(&robot.model);
        let late_s = 0.03;
        let mut term = (EFFECT.build)(&robot.site(), &[late_s]);
        // The first joint oscillates at half a hertz, the second one is at rest.
        let swing = |t: f64| {
            let (sin, cos) = (3.0 * t).sin_cos();
            [0.5 * sin, 1.5 * cos, -4.5 * sin]
        };
        for k in 0..200 {
            let t = 0.01 * f64::from(k);
            let [q, qd, qdd] = swing(t);
            let dt_s = if k == 0 { 0.0 } else { 0.01 };
            let at = sample(dt_s, t, [q, 0.3], [qd, 0.0], [qdd, 0.0]);
            let mut added = [0.0; 2];
            term.act(&at.view(), &mut added);
            let of = |data: &mut Data, [q, qd, qdd]: [f64; 3]| {
                let all = rnea(&robot.model, data, &[q, 0.3], &[qd, 0.0], &[qdd, 0.0]);
                [all[0], all[1]]
            };
            let (true_, recorded) = (
                of(&mut data, swing(t + late_s)),
                of(&mut data, [q, qd, qdd]),
            );
            let largest = recorded[0].abs().max(1.0);
            for j in 0..2 {
                let error = added[j] - (true_[j] - recorded[j]);
                // The jerk is known from the second sample on, with a delay of half a step.
                assert!(k == 0 || error.abs() < 0.02 * largest, "{k} {j}: {error}");
            }
        }
    }
}
