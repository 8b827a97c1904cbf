//! Effort that is reported late.

use super::delay_line::Delayed;
use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, Parameter, PlaceKind, Scale, Simulated,
    Traits, Words,
};

/// Recorded effort: the true one, delayed, with linear interpolation between samples, the same for all joints. Before
/// the first sample its value is held.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_delay",
    words: Words::new(
        "Torque delay",
        "torque delay",
        "The torque is reported late against the position.",
        "The recorder and the controller's clock: effort and position have not the same time.",
        "The effort is recorded {delay_s} late.",
    ),
    family: Family::Recording,
    place: PlaceKind::All,
    layer: Layer::Record,
    odds_nats: -3.0,
    parameters: &[Parameter::at_least("delay_s", 0.0)],
    coordinates: &[Coordinate::shape("delay_s", 0.002, 1.0, 12, Scale::Log)],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Fast,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|_| Drawn::new([1e-3, 0.2], |delay| vec![("delay_s", delay)])),
    traits: Traits {
        shifts_time: true,
        ..Traits::NONE
    },
    build: |site, values| Delayed::boxed(&EFFECT, site, None, array(values)),
};

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    /// Largest error for a linear effort, which interpolation reproduces exactly.
    fn error(delay_s: f64, dt_s: f64, samples: u32) -> f64 {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[delay_s]);
        let mut worst = 0.0_f64;
        for pass in 0..2 {
            term.reset();
            for k in 0..samples {
                let t = dt_s * f64::from(k);
                let mut effort = [3.0 + t, 3.0 - t];
                let at = sample(
                    if k > 0 { dt_s } else { 0.0 },
                    t,
                    [0.0; 2],
                    [0.0; 2],
                    [0.0; 2],
                );
                term.act(&at.view(), &mut effort);
                let then = (t - delay_s).max(0.0);
                let wrong = (effort[0] - 3.0 - then)
                    .abs()
                    .max((effort[1] - 3.0 + then).abs());
                assert!(wrong < 1e-9, "pass {pass}, {t}: {effort:?}, {then}");
                worst = worst.max(wrong);
            }
        }
        worst
    }

    #[test]
    fn a_straight_line_comes_later_at_any_rate() {
        for (delay_s, dt_s) in [
            (0.037, 0.01),
            (0.003, 0.01),
            (0.0, 0.01),
            (1.0, 0.0004),
            (2.5, 0.001),
        ] {
            let samples = (2.0 * delay_s / dt_s) as u32 + 20;
            assert!(error(delay_s, dt_s, samples) < 1e-9);
        }
    }
}
