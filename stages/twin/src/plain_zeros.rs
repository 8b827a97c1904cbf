//! Efforts that a driver publishes as plain zeros while it does not measure them.

use tauscope_bus::{JointArray, MAX_JOINTS};

/// Share of a joint's largest measured effort; a joint whose expected effort exceeds it is loaded.
/// Physical: effort sensors of arms are accurate to a few per cent and never read exactly zero under load.
const BEARS: f64 = 0.1;

/// Distinguishes measured zeros from zeros that stand for a missing measurement. Brakes that hold the arm and drives
/// that are off give the latter, too.
#[derive(Debug, Default)]
pub(crate) struct PlainZeros {
    /// Largest effort measured so far, by joint, in the measured effort's unit.
    largest: JointArray,
}

impl PlainZeros {
    /// Returns whether all efforts are exactly zero although a joint is loaded: then they are no measurement.
    pub fn are(&mut self, effort: &[f64], expected: &[f64]) -> bool {
        debug_assert!(effort.len() <= MAX_JOINTS);
        if effort.iter().any(|effort| *effort != 0.0) {
            for (largest, effort) in self.largest.iter_mut().zip(effort) {
                *largest = largest.max(effort.abs());
            }
            return false;
        }
        let joints = self.largest.iter().zip(expected);
        joints
            .into_iter()
            .any(|(largest, expected)| expected.abs() > BEARS * largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_of_a_loaded_arm_measure_nothing() {
        let mut zeros = PlainZeros::default();
        assert!(!zeros.are(&[5.0, 40.0], &[5.1, 39.0]));
        assert!(zeros.are(&[0.0, 0.0], &[0.1, 38.0]));
        assert!(
            !zeros.are(&[0.0, 38.0], &[0.1, 38.0]),
            "one sensor may be at zero"
        );
    }

    #[test]
    fn zeros_of_an_arm_that_bears_nothing_are_a_measurement() {
        // A SCARA at rest: coarse currents round to zero.
        let mut zeros = PlainZeros::default();
        assert!(!zeros.are(&[2.0, 1.0], &[2.1, 1.1]));
        assert!(!zeros.are(&[0.0, 0.0], &[0.05, 0.02]));
    }
}
