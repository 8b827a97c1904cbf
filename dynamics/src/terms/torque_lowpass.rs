//! A sensor with a low-pass.

use std::f64::consts::TAU;

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Site, Term, Traits, Words,
};

/// Recorded effort: the true one through a first-order low-pass, H(s) = ω / (s + ω), the same for all joints. Solved
/// exactly for an input that is linear between samples.
pub(super) static EFFECT: Effect = Effect {
    name: "torque_lowpass",
    words: Words::new(
        "Torque low-pass filter",
        "torque lowpass",
        "The reported torque is smoothed, so that fast changes are missing.",
        "The controller's settings: the effort is smoothed before it is reported.",
        "The effort is recorded through a low-pass of {cutoff_hz}.",
    ),
    family: Family::Recording,
    place: PlaceKind::All,
    layer: Layer::Record,
    odds_nats: -4.0,
    parameters: &[Parameter::at_least("cutoff_hz", 1e-3)],
    coordinates: &[Coordinate::shape("cutoff_hz", 0.3, 40.0, 24, Scale::Log)],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Fast,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|_| {
        Drawn::new([1e-3, 0.3], |time_s| {
            vec![("cutoff_hz", 1.0 / (TAU * time_s))]
        })
    }),
    traits: Traits {
        shifts_time: true,
        ..Traits::NONE
    },
    build: |site, values| Box::new(TorqueLowpass::new(site, array(values))),
};

#[derive(Debug)]
struct TorqueLowpass {
    values: [f64; 1],
    /// Input and output at the previous sample, by joint.
    state: Vec<(f64, f64)>,
    started: bool,
}

impl TorqueLowpass {
    fn new(site: &Site<'_>, values: [f64; 1]) -> Self {
        Self {
            values,
            state: vec![(0.0, 0.0); site.model.dof()],
            started: false,
        }
    }
}

impl Term for TorqueLowpass {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.started = false;
    }

    fn act(&mut self, at: &MotionSample<'_>, effort: &mut [f64]) {
        let started = std::mem::replace(&mut self.started, true);
        if started && at.dt_s <= 0.0 {
            for (effort, (_, output)) in effort.iter_mut().zip(&self.state) {
                *effort = *output;
            }
            return;
        }
        let steps = (TAU * self.values[0] * at.dt_s).max(0.0);
        let left = (-steps).exp();
        // Response to a ramp over the step, relative to the ramp: 1 - (1 - e^-s) / s.
        let ramp = if steps > 1e-4 {
            1.0 + (-steps).exp_m1() / steps
        } else {
            steps / 2.0
        };
        for (effort, (input, output)) in effort.iter_mut().zip(&mut self.state) {
            if started {
                let behind = *output - *input;
                let rise = *effort - *input;
                *output = *input + behind * left + rise * ramp;
            } else {
                *output = *effort;
            }
            *input = *effort;
            *effort = *output;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    #[test]
    fn smooths_as_the_differential_equation_does_on_any_clock() {
        let robot = TwoJoints::new();
        let cutoff_hz = 2.2;
        let mut term = (EFFECT.build)(&robot.site(), &[cutoff_hz]);
        let input = |t: f64| 5.0 * (3.0 * t).sin() + t;
        let (mut y, mut t, mut worst) = (0.0, 0.0, 0.0_f64);
        for k in 0..300 {
            let dt = if k == 0 {
                0.0
            } else {
                0.005 + 0.01 * f64::from(k % 3)
            };
            for i in 0..1000 {
                let u = input(t + dt * (f64::from(i) + 0.5) / 1000.0);
                y += dt / 1000.0 * TAU * cutoff_hz * (u - y);
            }
            t += dt;
            let mut effort = [input(t); 2];
            let at = sample(dt, t, [0.0; 2], [0.0; 2], [0.0; 2]);
            term.act(&at.view(), &mut effort);
            worst = worst.max((effort[1] - y).abs());
        }
        assert!(worst < 2e-3, "{worst}");
    }

    #[test]
    fn a_repeated_stamp_changes_nothing() {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), &[1.0]);
        let mut last = [0.0; 2];
        for dt in [0.0, 0.1, 0.0] {
            let mut effort = [if dt > 0.0 { 3.0 } else { last[0] }; 2];
            let at = sample(dt, 0.0, [0.0; 2], [0.0; 2], [0.0; 2]);
            let before = last;
            term.act(&at.view(), &mut effort);
            last = effort;
            assert!(dt > 0.0 || last == before, "{last:?} {before:?}");
        }
    }
}
