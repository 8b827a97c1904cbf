//! What friction may hold behind a contact, while the arm returns to its path.
//!
//! A contact moves a joint that stands out of its place. Its controller creeps it back, and static friction holds up
//! to its bound against that, for seconds where the controller has an integral part. Contact-free recordings show little
//! of this friction: a joint that a program stops comes to rest in the same way each time. So once most of a contact
//! has gone, the residual of a joint that stands says less for a while: the larger the contact was, the less. A contact
//! that goes on is not doubted.

/// A joint may hold by friction so much of the contact, in units of what is usual.
/// Tuned: on the practice set of cyclic moves, by `tauscope evaluate set.yaml --out results --detectors tauscope`, with
/// the sets of paths and assembly beside it. [`HOLDS`] and [`MOST`] at 0.5 and 6 leave 2.2 % of the free time in alarm,
/// at 1 and 10 0.9 %, without them 8.7 %; every collision is found with all of these.
const HOLDS: f64 = 1.0;
/// But no more than this, however large the contact was: static friction is bounded.
/// Tuned: as [`HOLDS`].
const MOST: f64 = 10.0;
/// How fast that fades \[s\].
/// Tuned: as [`HOLDS`].
const FADES_S: f64 = 1.5;
/// A joint that moves faster than this holds nothing by static friction \[rad/s, m/s\].
/// Tuned: the same as where a standing arm is told by; not swept.
const SLOW: f64 = 0.03;
/// What is left is forgotten from here on: it would change a noise by a hundredth.
/// Resolution: no score changes by more than that.
const FORGOTTEN: f64 = 0.01;

/// A contact of late, and what friction may hold of it, both in units of what is usual.
#[derive(Debug, Default)]
pub(super) struct Recovery {
    size: f64,
    held: f64,
    /// The share of the contact that has gone.
    gone: f64,
    newest_ns: i64,
}

impl Recovery {
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Takes the next instant, with the root of its score as it is without doubt, and whether a contact goes on.
    pub fn step(&mut self, now_ns: i64, size: f64, contact: bool) {
        let dt_s = (now_ns - std::mem::replace(&mut self.newest_ns, now_ns)) as f64 * 1e-9;
        if contact && size > self.size {
            self.size = size;
            self.held = (HOLDS * size).min(MOST).max(self.held);
        }
        if self.held < FORGOTTEN {
            (self.size, self.held) = (0.0, 0.0);
            return;
        }
        let fades = (-dt_s / FADES_S).exp();
        self.size *= fades;
        self.held *= fades;
        self.gone = (1.0 - size / self.size).max(0.0);
    }

    /// Whether there is any doubt.
    pub fn doubts(&self) -> bool {
        self.held * self.gone > 0.0
    }

    /// By how much the noise of a joint is larger that has been as slow as this \[rad/s, m/s\].
    pub fn doubt(&self, slow: f64) -> f64 {
        1.0 + self.held * self.gone * (1.0 - slow / SLOW).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// A contact of this size that lasts for a second and leaves so much behind it; the doubt of a standing joint then.
    fn behind(size: f64, left: f64, wait_ms: i64) -> Recovery {
        let mut recovery = Recovery::default();
        for k in 0..1000 {
            recovery.step(k * MS, size, true);
        }
        for k in 1000..1000 + wait_ms {
            recovery.step(k * MS, left, false);
        }
        recovery
    }

    #[test]
    fn a_contact_that_goes_on_is_not_doubted() {
        let recovery = behind(20.0, 20.0, 1);
        assert!(recovery.doubt(0.0) < 1.05, "{}", recovery.doubt(0.0));
    }

    #[test]
    fn a_joint_that_stands_is_doubted_behind_a_contact_and_for_seconds() {
        let soon = behind(20.0, 2.0, 50).doubt(0.0);
        let later = behind(20.0, 0.5, 1500).doubt(0.0);
        let after = behind(20.0, 0.5, 20_000).doubt(0.0);
        assert!(soon > 5.0, "{soon}");
        assert!(later > 2.0 && later < soon, "{later}");
        assert!(after < 1.001, "{after}");
    }

    #[test]
    fn a_joint_that_moves_is_not_doubted() {
        let doubt = behind(20.0, 2.0, 50).doubt(0.1);
        assert!(doubt < 1.001, "{doubt}");
    }

    #[test]
    fn no_contact_leaves_no_doubt() {
        let mut recovery = Recovery::default();
        for k in 0..1000 {
            recovery.step(k * MS, 3.0, false);
        }
        assert!(!recovery.doubts());
    }

    #[test]
    fn friction_holds_no_more_of_a_large_contact() {
        let [large, larger] = [50.0, 500.0].map(|size| behind(size, 1.0, 50).doubt(0.0));
        assert!((large - larger).abs() < 0.5, "{large} {larger}");
    }
}
