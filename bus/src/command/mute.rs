//! The mute as a lease: it starts at the stamp of its command and expires by itself.

use super::LONGEST_MUTE_S;
use crate::sample::{Command, Verb};

/// The mute of a cell, as an interval of stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MuteLease {
    /// Start \[ns since the epoch\].
    from_ns: i64,
    /// Expiry \[ns since the epoch\].
    until_ns: i64,
}

impl MuteLease {
    /// The lease of a mute command, starting at `stamp_ns`; `None` for any other command. A lease of 0 s expires at
    /// once and so revokes an earlier one.
    pub fn of(stamp_ns: i64, command: &Command) -> Option<Self> {
        let is_mute = command.verb() == Some(Verb::Mute);
        is_mute.then(|| Self {
            from_ns: stamp_ns,
            until_ns: stamp_ns
                .saturating_add((command.value.clamp(0.0, LONGEST_MUTE_S) * 1e9) as i64),
        })
    }

    /// Remaining time at `now_ns` \[ns\]; 0 before the start and after the expiry.
    pub fn left_ns(&self, now_ns: i64) -> i64 {
        if self.from_ns <= now_ns {
            self.until_ns.saturating_sub(now_ns).max(0)
        } else {
            0
        }
    }

    /// Whether the mute is in force at `now_ns`.
    pub fn holds(&self, now_ns: i64) -> bool {
        self.left_ns(now_ns) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mute(seconds: f64) -> Command {
        Command {
            value: seconds,
            ..Command::of(Verb::Mute)
        }
    }

    #[test]
    fn it_holds_from_its_stamp_until_it_ends() {
        let lease = MuteLease::of(1_000, &mute(2e-6)).unwrap();
        let held = [999, 1_000, 2_999, 3_000].map(|now_ns| lease.holds(now_ns));
        assert_eq!(held, [false, true, true, false]);
        assert_eq!(lease.left_ns(2_000), 1_000);
    }

    #[test]
    fn no_seconds_take_it_back_and_more_than_allowed_are_cut() {
        assert!(!MuteLease::of(0, &mute(0.0)).unwrap().holds(0));
        let longest_ns = (LONGEST_MUTE_S * 1e9) as i64;
        assert_eq!(
            MuteLease::of(0, &mute(1e12)).unwrap().left_ns(0),
            longest_ns
        );
        assert_eq!(MuteLease::of(0, &Command::of(Verb::Learn)), None);
    }
}
