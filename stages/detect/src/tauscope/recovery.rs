//! Residual that static friction may hold after a contact, while the arm returns to its path.
//!
//! A contact displaces a stationary joint. Its controller slowly moves the joint back. Static friction resists this
//! up to its bound, for seconds if the controller has an integral part. Contact-free recordings show little of this
//! friction: a joint that a program stops comes to rest in the same way each time. So once most of a contact has
//! vanished, the noise of a stationary joint is raised for a while, the more the larger the contact was. While the
//! contact lasts, the noise is not raised.

use super::stand::STILL_RAD_S;

/// Share of a contact that static friction in a joint may hold, both as roots of a score.
/// Tuned: on the practice set of cyclic moves, by `tauscope evaluate set.yaml --out results --detectors tauscope`,
/// together with the sets of paths and assembly. [`HOLDS`] and [`MOST`] at 0.5 and 6 leave 2.2 % of the free time in
/// alarm, at 1 and 10 0.9 %, without them 8.7 %; every collision is found with all of these.
const HOLDS: f64 = 1.0;
/// Upper bound of the held part, as a root of a score: static friction is bounded, however large the contact was.
/// Tuned: as [`HOLDS`].
const MOST: f64 = 10.0;
/// Time constant with which the residual that static friction holds after a contact creeps back \[s\].
/// Tuned: as [`HOLDS`], and for stationary arms on the sets named in [`tauscope`](crate::tauscope); not swept.
pub(super) const FADES_S: f64 = 1.5;
/// Held part below which the contact is forgotten: it would change a noise by a hundredth.
/// Resolution: no score changes by more than that.
const FORGOTTEN: f64 = 0.01;

/// A recent contact, and the part of it that static friction may hold, both as roots of a score.
#[derive(Debug, Default)]
pub(super) struct Recovery {
    size: f64,
    held: f64,
    /// Share of the contact that has vanished.
    gone: f64,
    newest_ns: i64,
}

impl Recovery {
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    /// Takes the next instant, with the root of its score before the noise is raised, and whether there is a contact.
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

    /// Returns whether the noise of stationary joints is raised.
    pub fn doubts(&self) -> bool {
        self.held * self.gone > 0.0
    }

    /// Returns the factor on the noise of a joint whose recent lowest speed is `slow` \[rad/s, m/s\].
    pub fn doubt(&self, slow: f64) -> f64 {
        // Static friction holds nothing in a joint that moves.
        1.0 + self.held * self.gone * (1.0 - slow / STILL_RAD_S).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// Returns the state after a contact of this size that lasts for a second, and after `wait_ms` with `left` of it.
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
