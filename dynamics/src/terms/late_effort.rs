//! Effort of one joint that is reported late: a separate channel, a sensor that is read less often than the others.

use super::delay_line::Delayed;
use super::law::array;
use super::{
    Coordinate, CoordinateKind, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind,
    Simulated, Traits, Words,
};

/// Recorded effort of the joint: the true one, delayed.
pub(super) static EFFECT: Effect = Effect {
    name: "late_effort",
    words: Words::new(
        "Late effort channel",
        "an effort channel that is late",
        "The torque of one joint is reported late against its position, and against the other joints.",
        "Joint {place}: how its torque is read and sent; is its channel slower, filtered or read less often than the others?",
        "The effort of joint {place} is recorded {delay_s} later than that of the other joints.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
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
    simulated: Simulated::Record,
    concealed: Some(|_| Drawn::new([1e-3, 0.2], |delay| vec![("delay_s", delay)])),
    traits: Traits {
        shifts_time: true,
        is_off_list: true,
        smallest_told_as: Some("delay_s"),
        ..Traits::NONE
    },
    build: |site, values| Delayed::boxed(&EFFECT, site, Some(site.joint), array(values)),
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn one_joint_comes_late_and_the_others_do_not() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[0.03]);
        for k in 0..20 {
            let t = 0.01 * f64::from(k);
            let dt_s = if k == 0 { 0.0 } else { 0.01 };
            let mut effort = [t, t];
            let at = sample(dt_s, t, [0.0; 2], [0.0; 2], [0.0; 2]);
            term.act(&at.view(), &mut effort);
            assert!((effort[0] - (t - 0.03).max(0.0)).abs() < 1e-12);
            assert!((effort[1] - t).abs() < 1e-12);
        }
    }
}
