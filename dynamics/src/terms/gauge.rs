//! The argument of a curve, computed sample by sample.

use super::{Against, MotionSample, STANDSTILL_RAD_S, sign};

/// Shortest standstill that counts as rest \[s\]; a reversal is shorter.
/// Derived: a reversal takes 2 [`STANDSTILL_RAD_S`] / a, which is 0.1 s at an acceleration a of only 0.2 rad/s².
const LEAST_REST_S: f64 = 0.1;

/// Initial time since the last rest, before any rest was observed \[s\].
/// Physical: longer than any recording.
const LONG_S: f64 = 1e7;
/// Initial travel since the last reversal \[rad or m\].
/// Physical: farther than any joint moves in one direction.
const FAR: f64 = 1e7;

/// Computes the argument of a curve, sample by sample.
#[derive(Debug, Clone)]
pub struct Gauge {
    against: Against,
    joint: usize,
    /// Largest absolute value of [`Against::LoadTurned`].
    band: f64,
    rested_s: f64,
    moved_s: f64,
    /// Direction of the present motion, and the distance travelled in it \[rad or m\].
    direction: f64,
    travel: f64,
    turned: f64,
    load: Option<f64>,
}

impl Gauge {
    /// Creates a gauge for the joint of index `joint`. `band` is the largest absolute value of
    /// [`Against::LoadTurned`] \[N m or N\].
    pub fn new(against: Against, joint: usize, band: f64) -> Self {
        Self {
            against,
            joint,
            band,
            rested_s: 0.0,
            moved_s: LONG_S,
            direction: 0.0,
            travel: FAR,
            turned: 0.0,
            load: None,
        }
    }

    /// Clears the state. The joint is then treated as long in motion, and its load as half reversed.
    pub fn reset(&mut self) {
        *self = Self::new(self.against, self.joint, self.band);
    }

    /// Returns the argument at the next instant.
    pub fn read(&mut self, at: &MotionSample<'_>) -> f64 {
        let joint = self.joint;
        match self.against {
            Against::Position => at.position[joint],
            Against::Velocity => at.velocity[joint],
            Against::VelocityDifference => at.velocity[joint] - next(at, joint),
            Against::VelocitySum => at.velocity[joint] + next(at, joint),
            Against::Acceleration => at.acceleration[joint],
            Against::Load => at.transmitted[joint],
            Against::DrivenLoad => at.transmitted[joint] * sign(at.velocity[joint]),
            Against::LoadTurned => {
                let load = at.transmitted[joint];
                let before = self.load.replace(load).unwrap_or(load);
                self.turned = (self.turned + load - before).clamp(-self.band, self.band);
                self.turned
            }
            Against::SinceRest => {
                if at.velocity[joint].abs() < STANDSTILL_RAD_S {
                    self.rested_s += at.dt_s;
                    if self.rested_s >= LEAST_REST_S {
                        self.moved_s = 0.0;
                    }
                } else {
                    self.rested_s = 0.0;
                }
                if self.rested_s < LEAST_REST_S {
                    self.moved_s += at.dt_s;
                }
                self.moved_s
            }
            Against::SinceTurn => {
                let velocity = at.velocity[joint];
                if velocity.abs() >= STANDSTILL_RAD_S {
                    let before = std::mem::replace(&mut self.direction, sign(velocity));
                    if before * self.direction < 0.0 {
                        self.travel = 0.0;
                    }
                    self.travel = FAR.min(self.travel + velocity.abs() * at.dt_s);
                }
                self.travel
            }
            Against::RecordingTime => at.recording_s,
            Against::SessionTime => at.session_s,
        }
    }
}

/// Velocity of the joint after `joint` in the URDF; 0 for the last one.
fn next(at: &MotionSample<'_>, joint: usize) -> f64 {
    at.velocity.get(joint + 1).copied().unwrap_or(0.0)
}

impl Against {
    /// Whether it depends on the effort that a joint's gear transmits.
    pub fn is_of_load(self) -> bool {
        matches!(self, Self::Load | Self::DrivenLoad | Self::LoadTurned)
    }

    /// Whether it is a time since a start that differs between runs.
    pub fn is_of_start(self) -> bool {
        matches!(self, Self::RecordingTime | Self::SessionTime)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arguments for the second joint of a robot at these velocities and loads, every 0.05 s.
    fn readings(against: Against, motion: &[(f64, f64)]) -> Vec<f64> {
        let mut gauge = Gauge::new(against, 1, 1.0);
        let read = |&(velocity, load): &(f64, f64)| {
            gauge.read(&MotionSample {
                dt_s: 0.05,
                recording_s: 0.0,
                session_s: 0.0,
                position: &[0.0; 2],
                velocity: &[0.0, velocity],
                acceleration: &[0.0; 2],
                transmitted: &[0.0, load],
            })
        };
        motion.iter().map(read).collect()
    }

    #[test]
    fn a_load_turns_within_its_band() {
        let turned = readings(
            Against::LoadTurned,
            &[(0.0, 2.0), (0.0, 2.5), (0.0, 9.0), (0.0, 8.5), (0.0, 3.0)],
        );
        assert_eq!(turned, [0.0, 0.5, 1.0, 0.5, -1.0]);
    }

    #[test]
    fn a_joint_rests_when_it_stands_still_and_not_when_it_reverses() {
        let since = |still: usize| {
            let mut motion = vec![(1.0, 0.0)];
            motion.extend(vec![(0.0, 0.0); still]);
            motion.extend(vec![(-1.0, 0.0); 2]);
            *readings(Against::SinceRest, &motion).last().unwrap()
        };
        assert!(since(1) > LONG_S);
        assert!((since(4) - 0.1).abs() < 1e-9);
    }

    #[test]
    fn the_way_since_a_joint_turned_round_counts_motion_alone() {
        let ways = readings(
            Against::SinceTurn,
            &[(1.0, 0.0), (-1.0, 0.0), (0.0, 0.0), (-2.0, 0.0), (0.5, 0.0)],
        );
        assert!(ways[0] >= FAR);
        for (way, wanted) in ways[1..].iter().zip([0.05, 0.05, 0.15, 0.025]) {
            assert!((way - wanted).abs() < 1e-12, "{ways:?}");
        }
    }

    #[test]
    fn two_velocities_are_taken_together_and_the_last_joint_has_no_next_one() {
        let of_first = |against: Against| {
            let mut gauge = Gauge::new(against, 0, 0.0);
            gauge.read(&MotionSample {
                dt_s: 0.05,
                recording_s: 0.0,
                session_s: 0.0,
                position: &[0.0; 2],
                velocity: &[0.5, 2.0],
                acceleration: &[0.0; 2],
                transmitted: &[0.0; 2],
            })
        };
        assert!((of_first(Against::VelocityDifference) + 1.5).abs() < 1e-12);
        assert!((of_first(Against::VelocitySum) - 2.5).abs() < 1e-12);
        let of_last = readings(Against::VelocityDifference, &[(2.0, 0.0)]);
        assert_eq!(of_last, [2.0]);
    }

    #[test]
    fn a_joint_drives_its_load_or_is_driven_by_it() {
        let driven = readings(Against::DrivenLoad, &[(0.5, 3.0), (-0.5, 3.0)]);
        assert_eq!(driven, [3.0, -3.0]);
    }
}
