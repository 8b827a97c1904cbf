//! Detection of jumps of the clock that stamps the joint states, relative to the time of reception.

use tauscope_bus::JointState;

/// Smallest change of (stamp - time of reception) between two samples that is treated as a jump \[ns\].
/// Resolution: above network delays, below the step by which a person sets a clock.
const JUMP_NS: i64 = 1_000_000_000;
/// Shortest time between two reports of a clock that jumps repeatedly \[ns\].
/// Resolution: a rate that a person can read.
const TOLD_EVERY_NS: i64 = 10_000_000_000;

/// Jump detector for the clock of one source.
#[derive(Debug, Default)]
pub struct Clock {
    /// Stamp and time of reception of the previous sample \[ns\].
    before: Option<(i64, i64)>,
    /// Time of reception at which a jump was last reported \[ns\].
    told_ns: Option<i64>,
    /// Number of jumps that are not reported yet, and their sum \[ns\].
    untold: (usize, i64),
}

impl Clock {
    /// Takes a sample; returns a line if a jump is to be reported.
    pub fn line(&mut self, state: &JointState) -> Option<String> {
        let now = (state.header.stamp_ns, state.header.received_ns);
        let before = self.before.replace(now)?;
        let jump_ns =
            (now.0.saturating_sub(before.0)).saturating_sub(now.1.saturating_sub(before.1));
        if jump_ns.saturating_abs() >= JUMP_NS {
            self.untold = (self.untold.0 + 1, self.untold.1.saturating_add(jump_ns));
        }
        let told_lately = self
            .told_ns
            .is_some_and(|told_ns| now.1 - told_ns < TOLD_EVERY_NS);
        if self.untold.0 == 0 || told_lately {
            return None;
        }
        self.told_ns = Some(now.1);
        let (times, sum_ns) = std::mem::take(&mut self.untold);
        let way = if sum_ns > 0 { "ahead" } else { "back" };
        let size_s = sum_ns.unsigned_abs() as f64 * 1e-9;
        let how_often = if times > 1 {
            format!(" in {times} jumps")
        } else {
            String::new()
        };
        Some(format!(
            "the clock of the joint states jumped {way} by {size_s:.1} s{how_often}: see how the robot's computer gets its time"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(stamp_s: f64, received_s: f64) -> JointState {
        let mut state = JointState::default();
        state.header.stamp_ns = (stamp_s * 1e9) as i64;
        state.header.received_ns = (received_s * 1e9) as i64;
        state
    }

    #[test]
    fn a_jump_is_told_and_a_pause_is_none() {
        let mut clock = Clock::default();
        let said = [
            (0.0, 0.0),
            (0.1, 0.1),
            // A pause of a minute, on both clocks.
            (60.1, 60.1),
            (3660.2, 60.2),
            // No further jump.
            (3660.3, 60.3),
            // The jump back, too soon after the first report: reported later.
            (62.0, 62.0),
            (80.0, 80.0),
            (80.1, 80.1),
        ]
        .map(|(stamp_s, received_s)| clock.line(&state(stamp_s, received_s)));
        let said = said.into_iter().flatten().collect::<Vec<_>>();
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("jumped ahead by 3600.0 s"), "{said:?}");
        assert!(said[1].contains("jumped back by 3600.0 s"), "{said:?}");
    }
}
