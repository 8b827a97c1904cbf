//! Whether the model behind the expected current holds at all (remark 1).
//!
//! A collision comes suddenly and is soon over. Where a joint's residue has been beyond the smallest
//! collision effort for most of the time, it is the model that is wrong: a payload that was declared
//! wrongly, or a work-piece that stayed in the gripper.

/// What a joint must have been beyond the limit for, and down to what until it holds again.
const WRONG_FROM: f64 = 0.5;
const WRONG_UNTIL: f64 = 0.25;
/// Memory of the share \[s\], and what the very first sample counts for \[s\]: a residue that is there
/// from the start is no collision.
const MEMORY_S: f64 = 10.0;
const FIRST_S: f64 = 1.0;

/// The share of the time that a joint's residue has been beyond a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Validity {
    limit: f64,
    share: f64,
    elapsed_s: f64,
    wrong: bool,
}

impl Validity {
    /// `limit`: the smallest collision effort \[effort unit\].
    pub fn new(limit: f64) -> Self {
        Self {
            limit,
            share: 0.0,
            elapsed_s: 0.0,
            wrong: false,
        }
    }

    /// Forgets what was.
    pub fn reset(&mut self) {
        *self = Self::new(self.limit);
    }

    /// Takes the next |R|; says whether the model is wrong.
    pub fn update(&mut self, dt_s: f64, residue: f64) -> bool {
        let beyond = f64::from(u8::from(residue > self.limit));
        if self.elapsed_s == 0.0 {
            self.elapsed_s = FIRST_S;
            self.share = beyond;
        } else {
            self.elapsed_s += dt_s;
            self.share += (dt_s / self.elapsed_s.min(MEMORY_S)).min(1.0) * (beyond - self.share);
        }
        self.wrong = self.share > if self.wrong { WRONG_UNTIL } else { WRONG_FROM };
        self.wrong
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the model is taken for wrong after `seconds` each of these residues, limit 1.
    fn wrong(spans: &[(f64, f64)]) -> bool {
        let mut validity = Validity::new(1.0);
        let mut wrong = false;
        for &(seconds, residue) in spans {
            for _ in 0..(seconds * 100.0) as usize {
                wrong = validity.update(0.01, residue);
            }
        }
        wrong
    }

    #[test]
    fn what_is_there_from_the_start_is_no_collision() {
        assert!(wrong(&[(0.01, 2.0)]));
        assert!(!wrong(&[(0.01, 0.9)]));
    }

    #[test]
    fn a_collision_is_too_short_and_a_payload_is_not() {
        assert!(!wrong(&[(20.0, 0.1), (2.0, 30.0)]));
        assert!(wrong(&[(20.0, 0.1), (10.0, 1.1)]));
        // Put down again, it is forgotten.
        assert!(!wrong(&[(20.0, 0.1), (10.0, 1.1), (10.0, 0.1)]));
    }
}
