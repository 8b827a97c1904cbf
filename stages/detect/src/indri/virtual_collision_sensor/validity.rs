//! Checks whether the model behind the expected current is valid at all (remark 1).
//!
//! A collision is sudden and short. If a joint's residue has been far above the smallest collision
//! effort for most of the time, the model is wrong: a payload was declared wrongly, or a work-piece
//! stayed in the gripper.

/// Limit of the residue, as a multiple of the smallest collision effort.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const FAR: f64 = 2.0;
/// Share of the time beyond the limit above which the model becomes wrong.
/// Derived: the majority of the time. A residue beyond the limit reaches it after ln 2 times [`MEMORY_S`], 7 s.
const WRONG_FROM: f64 = 0.5;
/// Share of the time beyond the limit down to which a wrong model stays wrong.
/// Chosen: half of [`WRONG_FROM`], as hysteresis. With a larger share the state chatters, a smaller one prolongs the
/// alarm after the model is right again.
const WRONG_UNTIL: f64 = 0.5 * WRONG_FROM;
/// Time constant of the share \[s\].
/// Chosen: a collision of 1.5 s (the longest of `tests/contacts/cyclic.py`) is then a fifth of the 7 s to
/// [`WRONG_FROM`]. A shorter time reports it as a model error, a longer one reports a wrong payload late.
const MEMORY_S: f64 = 10.0;
/// Minimum duration of evidence before a wrong model raises an alarm by itself \[s\].
/// Chosen: twice as long as such a collision, which may come directly after the start. A longer time delays the alarm
/// about a wrong payload.
const CERTAIN_S: f64 = 3.0;

/// The share of the time in which a joint's residue was far above the smallest collision effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Validity {
    limit: f64,
    share: f64,
    elapsed_s: f64,
    wrong: bool,
}

impl Validity {
    /// Creates the check with the joint's initial bias, the smallest effort treated as a collision \[effort unit\].
    pub fn new(bias: f64) -> Self {
        Self {
            limit: FAR * bias,
            share: 0.0,
            elapsed_s: 0.0,
            wrong: false,
        }
    }

    /// Discards the history.
    pub fn reset(&mut self) {
        (self.share, self.elapsed_s, self.wrong) = (0.0, 0.0, false);
    }

    /// Processes the next |R|, `dt_s` seconds after the previous one.
    pub fn update(&mut self, dt_s: f64, residue: f64) {
        let beyond = f64::from(u8::from(residue > self.limit));
        if self.elapsed_s == 0.0 {
            self.share = beyond;
        }
        self.elapsed_s += dt_s;
        if dt_s > 0.0 {
            let weight = (dt_s / self.elapsed_s.min(MEMORY_S)).min(1.0);
            self.share += weight * (beyond - self.share);
        }
        let from = if self.wrong { WRONG_UNTIL } else { WRONG_FROM };
        self.wrong = self.share > from;
    }

    /// Returns whether the model is probably wrong, so that an alarm is not a collision.
    pub fn is_doubtful(&self) -> bool {
        self.wrong
    }

    /// Returns whether the model has been wrong for long enough to raise an alarm by itself.
    pub fn is_wrong(&self) -> bool {
        self.wrong && self.elapsed_s >= CERTAIN_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the check after these spans of (duration \[s\], residue), with bias 1.
    fn after(spans: &[(f64, f64)]) -> Validity {
        let mut validity = Validity::new(1.0);
        for &(seconds, residue) in spans {
            for _ in 0..(seconds * 100.0) as usize {
                validity.update(0.01, residue);
            }
        }
        validity
    }

    #[test]
    fn what_is_there_from_the_start_is_no_collision() {
        let validity = after(&[(0.1, 3.0)]);
        assert!(validity.is_doubtful() && !validity.is_wrong());
        assert!(after(&[(3.5, 3.0)]).is_wrong());
        assert!(!after(&[(3.5, 1.9)]).is_doubtful());
    }

    #[test]
    fn a_collision_is_too_short_and_a_payload_is_not() {
        assert!(!after(&[(20.0, 0.1), (2.0, 30.0)]).is_doubtful());
        assert!(after(&[(20.0, 0.1), (10.0, 2.1)]).is_wrong());
        // After the payload is put down again, the model is valid again.
        assert!(!after(&[(20.0, 0.1), (10.0, 2.1), (20.0, 0.1)]).is_doubtful());
    }
}
