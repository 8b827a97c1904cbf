//! A torque sensor with hysteresis, as caused by flexures with friction at their clamps: K. Kuhnen, "Modeling,
//! Identification and Compensation of Complex Hysteretic Nonlinearities: A Modified Prandtl-Ishlinskii Approach",
//! *European Journal of Control* 9(4), 2003, section 2, with stop operators of evenly spaced widths and equal
//! weights.

use super::law::array;
use super::{
    Coordinate, Drawn, Effect, Excitation, Family, Layer, MotionSample, Parameter, PlaceKind,
    Scale, Simulated, Term, Traits, Words,
};

/// Number of stop operators.
/// Resolution: a curve of this many pieces lies within 3 % of one of any number.
const STOPS: usize = 4;

/// Recorded effort: τ - h z, where z is the mean of [`STOPS`] stop operators, each weighted by its width. A stop
/// follows the torque within ± its width; the widest has the width r.
///
/// z is 1 after the torque has risen by 2 r and -1 after it has fallen by as much, at any rate. A recording begins
/// with z = 0.
pub(super) static EFFECT: Effect = Effect {
    name: "sensor_hysteresis",
    words: Words::new(
        "Hysteresis of the torque sensor",
        "hysteresis of the torque sensor",
        "The torque sensor reads less while the torque rises than while it falls.",
        "Joint {place}: the torque sensor; are its screws tight, do a seal or a cable rub at it, was it overloaded?",
        "The torque sensor of joint {place} lags: it reads {hysteresis_nm} less while the torque rises and as much more while \
         it falls, and turns round within {turning_nm}.",
    ),
    family: Family::Recording,
    place: PlaceKind::Joint,
    layer: Layer::Record,
    odds_nats: -7.0,
    parameters: &[
        Parameter::at_least("hysteresis_nm", 0.0),
        Parameter::at_least("turning_nm", 0.0),
    ],
    coordinates: &[
        Coordinate::positive_factor("hysteresis_nm"),
        Coordinate::shape("turning_nm", 0.02, 0.5, 5, Scale::OfEffort),
    ],
    to_parameters: <[f64]>::to_vec,
    to_coordinates: <[f64]>::to_vec,
    simpler: None,
    excitation: Excitation::Poses,
    exported: super::Exported::No(super::export::OF_RECORDING),
    simulated: Simulated::Record,
    concealed: Some(|draw| {
        let turning = draw.largest_nm.max(1e-3) * draw.chance.between(0.05, 0.2);
        Drawn::new(draw.efforts_nm(), move |h| {
            vec![("hysteresis_nm", h), ("turning_nm", turning)]
        })
    }),
    traits: Traits {
        is_off_list: true,
        ..Traits::NONE
    },
    build: |site, values| {
        Box::new(SensorHysteresis {
            joint: site.joint,
            values: array(values),
            stops: [0.0; STOPS],
            before: None,
        })
    },
};

/// Smallest width of a stop \[N m or N\].
/// Resolution: keeps a quotient finite; far below any effort.
const LEAST_WIDTH: f64 = 1e-9;

#[derive(Debug)]
struct SensorHysteresis {
    joint: usize,
    values: [f64; 2],
    /// State of each stop relative to its width, from -1 to 1.
    stops: [f64; STOPS],
    /// Torque of the previous sample.
    before: Option<f64>,
}

impl Term for SensorHysteresis {
    fn effect(&self) -> &'static Effect {
        &EFFECT
    }

    fn coordinates(&self) -> &[f64] {
        &self.values
    }

    fn reset(&mut self) {
        self.stops = [0.0; STOPS];
        self.before = None;
    }

    fn act(&mut self, _at: &MotionSample<'_>, effort: &mut [f64]) {
        let [hysteresis, turning] = self.values;
        let effort = &mut effort[self.joint];
        let change = *effort - self.before.replace(*effort).unwrap_or(*effort);
        let (mut sum, mut widths) = (0.0, 0.0);
        for (k, stop) in self.stops.iter_mut().enumerate() {
            let share = (k + 1) as f64 / STOPS as f64;
            let width = (share * turning).max(LEAST_WIDTH);
            *stop = (*stop + change / width).clamp(-1.0, 1.0);
            sum += share * *stop;
            widths += share;
        }
        *effort -= hysteresis * sum / widths;
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{TwoJoints, sample};
    use super::*;

    /// Recorded efforts along torques of the first joint.
    fn readings(values: &[f64], torques: impl Iterator<Item = f64>) -> Vec<f64> {
        let robot = TwoJoints::new();
        let mut term = (EFFECT.build)(&robot.site(), values);
        let read = |torque| {
            let mut effort = [torque, 9.0];
            let at = sample(0.01, 0.0, [0.0; 2], [0.0; 2], [0.0; 2]);
            term.act(&at.view(), &mut effort);
            assert_eq!(effort[1], 9.0);
            effort[0]
        };
        torques.map(read).collect()
    }

    #[test]
    fn it_reads_less_while_the_torque_rises_and_more_while_it_falls() {
        let up = (0..=100).map(|k| 0.1 * f64::from(k));
        let down = (0..=100).map(|k| 10.0 - 0.1 * f64::from(k));
        let read = readings(&[0.3, 0.5], up.chain(down));
        assert!((read[100] - 9.7).abs() < 1e-6 && (read[201] - 0.3).abs() < 1e-6);
        assert!((read[50] - 4.7).abs() < 1e-3 && (read[151] - 5.3).abs() < 1e-3);
    }

    #[test]
    fn how_fast_the_torque_changes_does_not_matter() {
        let path = |steps: u32| {
            let steps = f64::from(steps);
            move |k: u32| 4.0 * (f64::from(k) / steps)
        };
        let slow = readings(&[0.3, 2.0], (0..=400).map(path(400)));
        let fast = readings(&[0.3, 2.0], (0..=4).map(path(4)));
        assert!((slow[400] - fast[4]).abs() < 1e-9);
    }

    #[test]
    fn a_turn_goes_twice_as_far_as_a_start() {
        // Masing's rule, which holds for friction in clamps.
        let read = readings(&[1.0, 2.0], [0.0, 1.0, 5.0, 3.0].into_iter());
        let (start, turn) = (1.0 - read[1], read[3] - 3.0);
        assert!((1.0 - 2.0 * start + turn).abs() < 1e-9, "{start} {turn}");
    }

    #[test]
    fn a_steady_torque_keeps_what_was_read() {
        let read = readings(&[0.3, 0.5], [0.0, 2.0, 2.0, 2.0].into_iter());
        assert_eq!(read[1..], [read[1]; 3]);
    }
}
