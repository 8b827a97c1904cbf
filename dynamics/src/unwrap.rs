//! Positions of joints that turn without limits, unwrapped where the driver subtracts whole turns.

use std::f64::consts::TAU;

/// Longest time between two positions over which a turn is unwrapped \[ns\].
/// Physical: a joint at 3 rad/s turns by less than [`SMALL_RAD`] in this time.
const LONGEST_NS: i64 = 250_000_000;
/// Upper bound on the step before a wrap, and on the step of a wrap after the whole turn is subtracted \[rad\].
/// Physical: most arms turn no joint faster than 3 rad/s. Degrees read as radians step by more than this before they
/// step by 6.28.
const SMALL_RAD: f64 = 0.75;

/// Unwraps the position of one joint: a step by a whole turn is the driver's wrap, not a motion.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwrap {
    last: Option<(i64, f64)>,
    step: f64,
    turns: f64,
}

impl Unwrap {
    /// Returns the position \[rad\] without the wraps since the first one. Over a gap the number of whole turns stays
    /// the same; a position in m never steps like this.
    pub fn next(&mut self, stamp_ns: i64, position: f64) -> f64 {
        let before = self.last.replace((stamp_ns, position));
        let before = before.filter(|(at, _)| stamp_ns.saturating_sub(*at) <= LONGEST_NS);
        let step = before.map_or(0.0, |(_, before)| position - before);
        let rest = step - TAU.copysign(step);
        let wraps = rest.abs() < SMALL_RAD && self.step.abs() < SMALL_RAD;
        self.step = if wraps { rest } else { step };
        if wraps {
            self.turns -= step.signum();
        }
        position + TAU * self.turns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn unwrapped(positions: impl Iterator<Item = f64>, step_ms: i64) -> Vec<f64> {
        let mut unwrap = Unwrap::default();
        let each = (0..).zip(positions);
        each.map(|(i, position)| unwrap.next(i * step_ms * MS, position))
            .collect()
    }

    #[test]
    fn a_joint_that_turns_on_and_back_is_followed_through_every_wrap() {
        let real: Vec<f64> = (0..2000)
            .map(|i| 12.0 * (0.003 * f64::from(i)).sin())
            .collect();
        for wrap in [
            |x: f64| x.rem_euclid(TAU),
            |x: f64| x - TAU * (x / TAU).round(),
        ] {
            let seen = unwrapped(real.iter().map(|&x| wrap(x)), 10);
            for (seen, real) in seen.iter().zip(&real) {
                assert!((seen - real).abs() < 1e-9, "{seen} {real}");
            }
        }
    }

    #[test]
    fn jumps_of_another_size_gaps_and_degrees_stay_as_they_are() {
        let jump = [0.0, 0.01, 1.6, 1.61];
        assert_eq!(unwrapped(jump.into_iter(), 10), jump);
        let gap = [0.1, 6.2, 6.21];
        assert_eq!(unwrapped(gap.into_iter(), 300), gap);
        // 63 degrees per second at 10 Hz, starting from rest.
        let degrees = [0.0, 1.5, 4.5, 10.8, 17.1, 23.4];
        assert_eq!(unwrapped(degrees.into_iter(), 100), degrees);
    }
}
