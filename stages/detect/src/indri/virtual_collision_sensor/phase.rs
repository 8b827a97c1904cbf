//! The five-state machine of a joint (section 3.2, figure 6): the trends of measured and expected current decide
//! whether the collision test is made.

use super::trend::{Band, NoiseBounds, Trend};

/// Share of their noise below which both derivatives of the expected current must be for the steady state to begin.
/// Chosen: half of [`STEADY_UNTIL`], as hysteresis. With a larger share the state chatters, a smaller one is rarely
/// reached in the presence of noise.
const STEADY_BELOW: f64 = 0.5 * STEADY_UNTIL;
/// Share of their noise up to which both derivatives may rise before the steady state ends.
/// Chosen: noise hides a change of up to its standard deviation. With a smaller share noise alone ends the steady
/// state, a larger one treats slow motion as steady.
const STEADY_UNTIL: f64 = 1.0;

/// State of the trends of a joint's currents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phase {
    /// The expected current is almost constant.
    #[default]
    Steady,
    /// Both vary together: the only safe state, without a collision test.
    Moving,
    /// The measured current has changed its trend, the expected one has not.
    Reversing,
    /// The expected current has changed its trend, the measured one has not.
    ReversingDm,
    /// The measured current jumps and the expected one does not.
    Impulse,
}

impl Phase {
    /// Returns whether the collision test (equation 3) is made.
    pub fn is_tested(self) -> bool {
        self != Self::Moving
    }
}

/// The state machine.
#[derive(Debug, Clone, Default)]
pub(super) struct PhaseMachine {
    phase: Phase,
    /// Rates of the measured and of the expected current at the previous sample.
    before: (f64, f64),
}

impl PhaseMachine {
    /// Returns the state after a sample with these trends. `omega_rad_s` is the low-pass's cutoff; the noise of the
    /// second derivative is that of the rate times this frequency.
    pub fn update(
        &mut self,
        measured: &Trend,
        expected: &Trend,
        noise: &NoiseBounds,
        omega_rad_s: f64,
    ) -> Phase {
        let rates = (measured.rate, expected.rate);
        let limit = noise.sigma()
            * match self.phase {
                Phase::Steady => STEADY_UNTIL,
                _ => STEADY_BELOW,
            };
        let steady =
            expected.rate.abs() <= limit && expected.curvature.abs() <= limit * omega_rad_s;
        self.phase = if steady {
            Phase::Steady
        } else {
            self.unsteady(rates, noise)
        };
        self.before = rates;
        self.phase
    }

    fn unsteady(&self, (measured, expected): (f64, f64), noise: &NoiseBounds) -> Phase {
        let differ = measured * expected < 0.0;
        match noise.band(measured - expected) {
            Band::Impulse => Phase::Impulse,
            Band::Noise => Phase::Moving,
            Band::Beyond if differ => {
                let (was_measured, was_expected) = self.before;
                let measured_turned = measured * was_measured <= 0.0;
                let expected_turned = expected * was_expected <= 0.0;
                match self.phase {
                    _ if measured_turned => Phase::Reversing,
                    _ if expected_turned => Phase::ReversingDm,
                    // Neither turned at this sample: the one that turned before still differs.
                    Phase::ReversingDm => Phase::ReversingDm,
                    _ => Phase::Reversing,
                }
            }
            Band::Beyond if noise.is_over(measured) && noise.is_over(expected) => Phase::Moving,
            // The paper defines no transition here: the state is kept, except that Steady changes to Moving.
            Band::Beyond => match self.phase {
                Phase::Steady => Phase::Moving,
                other => other,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OMEGA: f64 = 94.0;

    fn trend(rate: f64) -> Trend {
        let mut trend = Trend::new(15.0);
        trend.rate = rate;
        trend
    }

    /// Noise of mean 0 and deviation 1: bounds at ±3, the higher ones at ±6.
    fn noise() -> NoiseBounds {
        let mut noise = NoiseBounds::default();
        for k in 0..5000 {
            noise.update(0.002, if k % 2 == 0 { 1.0 } else { -1.0 });
        }
        noise
    }

    /// The states after samples with these rates of the measured and the expected current.
    fn phases(rates: &[(f64, f64)]) -> Vec<Phase> {
        let (mut machine, noise) = (PhaseMachine::default(), noise());
        rates
            .iter()
            .map(|&(i, dm)| machine.update(&trend(i), &trend(dm), &noise, OMEGA))
            .collect()
    }

    #[test]
    fn an_expected_current_that_stands_is_steady_whatever_the_measured_one_does() {
        assert_eq!(
            phases(&[(0.0, 0.0), (50.0, 0.1), (0.2, 0.9)]),
            [Phase::Steady; 3]
        );
        // Hysteresis: the steady state returns only well below the limit.
        let back = phases(&[(20.0, 20.0), (0.7, 0.7), (0.4, 0.4)]);
        assert_eq!(back, [Phase::Moving, Phase::Moving, Phase::Steady]);
    }

    #[test]
    fn a_bend_of_the_expected_current_ends_the_steady_state() {
        let (mut machine, noise) = (PhaseMachine::default(), noise());
        let mut bend = trend(0.0);
        bend.curvature = 2.0 * OMEGA;
        assert_eq!(
            machine.update(&trend(0.0), &bend, &noise, OMEGA),
            Phase::Moving
        );
    }

    #[test]
    fn currents_that_vary_together_are_moving_and_are_not_tested() {
        // Within the noise bounds (figure 8a), and both beyond with one sign (figure 8b).
        assert_eq!(phases(&[(22.0, 20.0), (25.0, 20.0)]), [Phase::Moving; 2]);
        assert!(!Phase::Moving.is_tested());
        for phase in [
            Phase::Steady,
            Phase::Reversing,
            Phase::ReversingDm,
            Phase::Impulse,
        ] {
            assert!(phase.is_tested());
        }
    }

    #[test]
    fn an_error_over_the_higher_bound_is_an_impulse() {
        assert_eq!(phases(&[(20.0, 20.0), (27.0, 20.0)])[1], Phase::Impulse);
        assert_eq!(
            phases(&[(20.0, 20.0), (27.0, 20.0), (21.0, 20.0)])[2],
            Phase::Moving
        );
    }

    #[test]
    fn whichever_current_turns_is_the_one_that_reverses() {
        let measured = phases(&[(2.0, 3.0), (-1.0, 3.0), (-1.5, 3.0)]);
        assert_eq!(
            measured,
            [Phase::Moving, Phase::Reversing, Phase::Reversing]
        );
        let expected = phases(&[(3.0, 2.0), (3.0, -1.5), (3.2, -1.6)]);
        assert_eq!(
            expected,
            [Phase::Moving, Phase::ReversingDm, Phase::ReversingDm]
        );
    }

    #[test]
    fn where_the_paper_names_no_transition_the_state_stays() {
        // Beyond the bounds, one sign, one of the two within: neither case of Moving.
        assert_eq!(phases(&[(20.0, 20.0), (6.5, 2.0)])[1], Phase::Moving);
        assert_eq!(phases(&[(27.0, 20.0), (6.5, 2.0)])[1], Phase::Impulse);
    }
}
