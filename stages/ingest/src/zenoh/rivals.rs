//! Publishers that send the same joints on one topic: a driver that was started twice, or a bag that is played while
//! the robot runs. A mixture of their states would not be the motion of any arm.

/// Minimum silence after which a publisher may be replaced \[ns\]; see also [`SILENT_PERIODS`].
/// Physical: shorter than the start of a driver.
const SILENT_NS: i64 = 500_000_000;
/// Minimum silence after which a publisher may be replaced, in its own periods.
/// Statistical: two messages may be lost.
const SILENT_PERIODS: i64 = 3;
/// Maximum number of accepted publishers; a robot's joints may be spread over several.
/// Resolution: memory; more than arms have joints.
const MAX_HEARD: usize = 32;

/// An accepted publisher.
#[derive(Debug, Clone, Copy)]
struct Heard {
    publisher: [u8; 16],
    /// Joints that it sends: bit j is joint j.
    joints: u32,
    last_ns: i64,
    period_ns: i64,
}

impl Heard {
    fn speaks(&self, now_ns: i64) -> bool {
        let patience_ns = SILENT_NS.max(self.period_ns.saturating_mul(SILENT_PERIODS));
        // Absolute: a clock of reception that is set back must not keep it accepted for ever.
        (now_ns - self.last_ns).saturating_abs() < patience_ns
    }
}

/// Accepts one publisher for each joint: the first one, until it falls silent.
#[derive(Debug, Default)]
pub(super) struct Rivals {
    heard: Vec<Heard>,
    refused: u64,
    /// The publisher that was refused last, and the time of its message.
    newest_refused: Option<([u8; 16], i64)>,
    /// Time of the last message of an accepted publisher while another one was being refused. A restarted driver does
    /// not set it, since the old one is silent.
    beside_ns: Option<i64>,
}

impl Rivals {
    /// Returns whether a message of `publisher` with these joints, received at `now_ns`, is accepted.
    pub fn admits(&mut self, publisher: [u8; 16], joints: u32, now_ns: i64) -> bool {
        let is_rival = |other: &Heard| {
            other.publisher != publisher && other.joints & joints != 0 && other.speaks(now_ns)
        };
        if self.heard.iter().any(is_rival) {
            self.refused += 1;
            self.newest_refused = Some((publisher, now_ns));
            return false;
        }
        if let Some(heard) = self.heard.iter_mut().find(|it| it.publisher == publisher) {
            let is_other =
                |&(other, at_ns): &([u8; 16], i64)| other != publisher && is_recent(at_ns, now_ns);
            if self.newest_refused.as_ref().is_some_and(is_other) {
                self.beside_ns = Some(now_ns);
            }
            heard.period_ns = (now_ns - heard.last_ns).max(0);
            heard.last_ns = now_ns;
            heard.joints |= joints;
            return true;
        }
        self.heard.retain(|other| other.speaks(now_ns));
        if self.heard.len() < MAX_HEARD {
            self.heard.push(Heard {
                publisher,
                joints,
                last_ns: now_ns,
                period_ns: 0,
            });
        }
        true
    }

    /// Returns the number of refused messages.
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Whether two publishers have sent the same joints recently.
    pub fn are_there(&self, now_ns: i64) -> bool {
        self.beside_ns.is_some_and(|at_ns| is_recent(at_ns, now_ns))
    }
}

fn is_recent(at_ns: i64, now_ns: i64) -> bool {
    (now_ns - at_ns).saturating_abs() < 2 * SILENT_NS
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn the_first_publisher_of_a_joint_is_heard_until_it_ceases() {
        let mut rivals = Rivals::default();
        let (robot, bag) = ([1; 16], [2; 16]);
        for ms in 0..1000 {
            assert!(rivals.admits(robot, 0b11, ms * MS));
            assert!(!rivals.admits(bag, 0b10, ms * MS), "{ms}");
        }
        assert_eq!(rivals.refused(), 1000);
        assert!(rivals.are_there(1000 * MS));
        // The robot's driver has ended: the other publisher is accepted after the silence.
        assert!(!rivals.admits(bag, 0b10, 1400 * MS));
        assert!(rivals.admits(bag, 0b10, 1600 * MS));
        assert!(!rivals.admits(robot, 0b11, 1700 * MS));
        assert!(!rivals.are_there(5000 * MS));
    }

    #[test]
    fn a_driver_that_is_started_again_is_no_second_one() {
        let mut rivals = Rivals::default();
        for ms in 0..1000 {
            assert!(rivals.admits([1; 16], 1, ms * MS));
        }
        for ms in 1100..3000 {
            rivals.admits([2; 16], 1, ms * MS);
            assert!(!rivals.are_there(ms * MS), "{ms}");
        }
        assert!(rivals.admits([2; 16], 1, 3000 * MS));
    }

    #[test]
    fn publishers_of_different_joints_are_all_heard() {
        let mut rivals = Rivals::default();
        for ms in 0..100 {
            assert!(rivals.admits([1; 16], 0b01, ms * MS));
            assert!(rivals.admits([2; 16], 0b10, ms * MS));
        }
        assert_eq!(rivals.refused(), 0);
    }

    #[test]
    fn a_publisher_that_speaks_seldom_is_not_taken_for_one_that_has_ceased() {
        let mut rivals = Rivals::default();
        for s in 0..10 {
            assert!(rivals.admits([1; 16], 1, s * 1000 * MS));
            if s > 0 {
                assert!(!rivals.admits([2; 16], 1, (s * 1000 + 700) * MS), "{s}");
            }
        }
    }
}
