//! Whether the model behind the expected current holds at all (remark 1).
//!
//! A collision comes suddenly and is soon over. Where a joint's residue has been far beyond the
//! smallest collision effort for most of the time, it is the model that is wrong: a payload that was
//! declared wrongly, or a work-piece that stayed in the gripper.

/// Far beyond: this many times the smallest collision effort.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const FAR: f64 = 2.0;
/// The share of the time from which on a model is wrong.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const WRONG_FROM: f64 = 0.5;
/// And down to which it stays so.
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const WRONG_UNTIL: f64 = 0.25;
/// Memory of the share \[s\].
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const MEMORY_S: f64 = 10.0;
/// What it takes at least to say so where there is no other alarm \[s\].
/// Tuned: on the practice set of cyclic moves (docs/papers.md); not swept.
const CERTAIN_S: f64 = 3.0;

/// The share of the time that a joint's residue has been far beyond the smallest collision effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Validity {
    limit: f64,
    share: f64,
    elapsed_s: f64,
    wrong: bool,
}

impl Validity {
    /// With the first bias of the joint, the smallest effort that is a collision \[effort unit\].
    pub fn new(bias: f64) -> Self {
        Self {
            limit: FAR * bias,
            share: 0.0,
            elapsed_s: 0.0,
            wrong: false,
        }
    }

    /// Forgets what was.
    pub fn reset(&mut self) {
        (self.share, self.elapsed_s, self.wrong) = (0.0, 0.0, false);
    }

    /// Takes the next |R|, `dt_s` seconds after the one before.
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

    /// Whether the model is wrong as far as one knows: an alarm now is no collision.
    pub fn is_doubtful(&self) -> bool {
        self.wrong
    }

    /// Whether that has lasted long enough to be an alarm of its own.
    pub fn is_wrong(&self) -> bool {
        self.wrong && self.elapsed_s >= CERTAIN_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After `seconds` each of these residues, bias 1.
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
        // Put down again, it is forgotten.
        assert!(!after(&[(20.0, 0.1), (10.0, 2.1), (20.0, 0.1)]).is_doubtful());
    }
}
