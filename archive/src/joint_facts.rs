//! What is odd about the joint states of a recording, joint by joint, found in one pass with bounded memory.

use serde::Serialize;

use crate::ros::JointState;

/// Positions are compared with the integral of the velocity over at least this long \[ns\].
/// Physical: ten samples at 100 Hz, so that an encoder's step is small beside the motion.
const SPAN_NS: i64 = 100_000_000;
/// After a longer pause the comparison begins anew \[ns\].
/// Physical: an arm may have come and gone in half a second.
const PAUSE_NS: i64 = 500_000_000;
/// A joint that has moved less than this in all does not tell whether its velocity fits \[rad or m\].
/// Physical: a hundred steps of a coarse encoder of 6000 steps per turn.
const TELLING_MOTION: f64 = 0.1;
/// A velocity that is off by more than this share is odd.
/// Physical: low-passed velocities of real drives keep within 5 % of the derivative over 0.1 s.
const ODD_SHARE: f64 = 0.1;
/// Velocity over the derivative of position where positions are in degrees and velocities in rad/s.
const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

/// A joint over all messages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFacts {
    /// Its name.
    pub name: String,
    /// Smallest and largest position \[rad or m\].
    pub position_range: Option<[f64; 2]>,
    /// The recorded velocity over the derivative of the position, where the joint moves enough to tell: 1 as it should
    /// be.
    pub velocity_slope: Option<f64>,
    /// How far it moved in all \[rad or m\]; 0 where velocities or positions are missing.
    pub travel: f64,
    /// Whether efforts are given and all of them are 0.
    pub effort_is_zero: bool,
    /// Whether no effort is given that is a number.
    pub lacks_effort: bool,
}

impl JointFacts {
    /// Whether its positions are in degrees, told by its velocities.
    pub fn is_in_degrees(&self) -> bool {
        let slope = self.velocity_slope;
        slope.is_some_and(|slope| (slope / RADIANS_PER_DEGREE - 1.0).abs() < ODD_SHARE)
    }

    /// What is odd about it, in words.
    pub fn remark(&self) -> Option<String> {
        let slope = self
            .velocity_slope
            .filter(|slope| (slope - 1.0).abs() > ODD_SHARE)?;
        let hint = if slope < 0.0 {
            ": one of them has the other sign"
        } else if self.is_in_degrees() {
            ": positions are in degrees"
        } else {
            ""
        };
        Some(format!(
            "the velocity of {} is {slope:.3} times the derivative of its position{hint}",
            self.name
        ))
    }
}

/// Follows the joints of one topic, with memory for the joints alone. A message may name its joints in another order than the one before.
#[derive(Debug, Default)]
pub struct JointTallies {
    joints: Vec<JointTally>,
    last: Option<JointState>,
    /// Messages whose values are those of the message before.
    pub repeated: u64,
    /// Messages stamped before the one that they follow.
    pub backward: u64,
}

/// One joint.
#[derive(Debug)]
struct JointTally {
    name: String,
    range: Option<[f64; 2]>,
    efforts: u64,
    zeros: u64,
    /// Position and stamp at which the span of the comparison begins, and the velocity integrated since.
    from: Option<(f64, i64)>,
    before: Option<(f64, i64)>,
    integral: f64,
    /// Sums over spans: position change squared, times the integral, and absolute.
    squares: f64,
    products: f64,
    moved: f64,
}

impl JointTally {
    fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            range: None,
            efforts: 0,
            zeros: 0,
            from: None,
            before: None,
            integral: 0.0,
            squares: 0.0,
            products: 0.0,
            moved: 0.0,
        }
    }

    /// Takes position, velocity and effort, as far as they are given and numbers.
    fn add(&mut self, stamp_ns: i64, values: [Option<f64>; 3]) {
        let [position, velocity, effort] = values.map(|value| value.filter(|it| it.is_finite()));
        if let Some(effort) = effort {
            self.efforts += 1;
            self.zeros += u64::from(effort == 0.0);
        }
        let Some(position) = position else {
            return;
        };
        self.add_position(position);
        if let Some(velocity) = velocity {
            self.add_velocity(stamp_ns, position, velocity);
        }
    }

    fn add_position(&mut self, position: f64) {
        let [low, high] = self.range.unwrap_or([position; 2]);
        self.range = Some([low.min(position), high.max(position)]);
    }

    fn add_velocity(&mut self, stamp_ns: i64, position: f64, velocity: f64) {
        let step_ns = self.before.map(|(_, before_ns)| stamp_ns - before_ns);
        match (self.before, step_ns, self.from) {
            (Some((before, _)), Some(step_ns), Some((from, from_ns)))
                if (0..PAUSE_NS).contains(&step_ns) =>
            {
                self.integral += 0.5 * (before + velocity) * step_ns as f64 * 1e-9;
                if stamp_ns - from_ns >= SPAN_NS {
                    let change = position - from;
                    self.squares += change * change;
                    self.products += change * self.integral;
                    self.moved += change.abs();
                    self.from = Some((position, stamp_ns));
                    self.integral = 0.0;
                }
            }
            _ => {
                self.from = Some((position, stamp_ns));
                self.integral = 0.0;
            }
        }
        self.before = Some((velocity, stamp_ns));
    }

    fn facts(&self) -> JointFacts {
        JointFacts {
            name: self.name.clone(),
            position_range: self.range,
            velocity_slope: (self.moved > TELLING_MOTION).then(|| self.products / self.squares),
            travel: self.moved,
            lacks_effort: self.efforts == 0,
            effort_is_zero: self.efforts > 0 && self.zeros == self.efforts,
        }
    }
}

impl JointTallies {
    /// Takes a message.
    pub fn add(&mut self, state: &JointState) {
        let stamp_ns = state.header.stamp.ns();
        if let Some(last) = &self.last {
            let same = last.name == state.name
                && last.position == state.position
                && last.velocity == state.velocity
                && last.effort == state.effort;
            self.repeated += u64::from(same);
            self.backward += u64::from(stamp_ns < last.header.stamp.ns());
        }
        for (at, name) in state.name.iter().enumerate() {
            // In nearly all recordings every message has the order of the first.
            let place = match self.joints.get(at) {
                Some(joint) if joint.name == *name => at,
                _ => self.place(name),
            };
            let of = |values: &[f64]| values.get(at).copied();
            let values = [of(&state.position), of(&state.velocity), of(&state.effort)];
            self.joints[place].add(stamp_ns, values);
        }
        self.last.get_or_insert_default().clone_from(state);
    }

    /// For samples that hold their joints always in the order of `names`.
    pub fn in_order(names: &[String]) -> Self {
        let joints = names.iter().map(|name| JointTally::new(name)).collect();
        Self {
            joints,
            ..Self::default()
        }
    }

    /// Takes the values of one instant; no values for what the source does not give.
    pub fn add_values(
        &mut self,
        stamp_ns: i64,
        position: &[f64],
        velocity: &[f64],
        effort: &[f64],
    ) {
        for (at, joint) in self.joints.iter_mut().enumerate() {
            let of = |values: &[f64]| values.get(at).copied();
            joint.add(stamp_ns, [of(position), of(velocity), of(effort)]);
        }
    }

    fn place(&mut self, name: &str) -> usize {
        let known = self.joints.iter().position(|joint| joint.name == name);
        known.unwrap_or_else(|| {
            self.joints.push(JointTally::new(name));
            self.joints.len() - 1
        })
    }

    /// By joint, in the order of their first message.
    pub fn facts(&self) -> Vec<JointFacts> {
        self.joints.iter().map(JointTally::facts).collect()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on has failed")]

    use super::*;
    use crate::ros::{Header, Time};

    /// A joint that swings by half a radian, its recorded velocity `slope` times the true one, positions in `units`.
    fn swing(slope: f64, units: f64) -> JointFacts {
        let mut tallies = JointTallies::default();
        for i in 0..1000_u32 {
            let t = f64::from(i) * 0.01;
            let state = JointState {
                header: Header {
                    stamp: Time::from_ns(i64::from(i) * 10_000_000),
                    ..Header::default()
                },
                name: vec!["elbow".to_owned()],
                position: vec![0.5 * t.sin() * units],
                velocity: vec![0.5 * t.cos() * slope],
                effort: vec![0.0],
            };
            tallies.add(&state);
        }
        tallies.facts().remove(0)
    }

    #[test]
    fn a_velocity_that_is_the_derivative_is_not_remarked() {
        let facts = swing(1.0, 1.0);
        assert!((facts.velocity_slope.unwrap() - 1.0).abs() < 1e-3);
        assert_eq!(facts.remark(), None);
        assert!(facts.effort_is_zero);
    }

    #[test]
    fn half_a_velocity_a_turned_one_and_degrees_are_remarked() {
        assert!(swing(0.5, 1.0).remark().unwrap().contains("0.500 times"));
        assert!(swing(-1.0, 1.0).remark().unwrap().contains("other sign"));
        assert!(
            swing(1.0, 180.0 / std::f64::consts::PI)
                .remark()
                .unwrap()
                .contains("degrees")
        );
    }

    #[test]
    fn repeats_and_stamps_that_step_back_are_counted() {
        let at = |ns: i64, position: f64| JointState {
            header: Header {
                stamp: Time::from_ns(ns),
                ..Header::default()
            },
            name: vec!["elbow".to_owned()],
            position: vec![position],
            velocity: Vec::new(),
            effort: Vec::new(),
        };
        let mut tallies = JointTallies::default();
        for state in [at(10, 0.0), at(10, 0.0), at(20, 0.1), at(15, 0.2)] {
            tallies.add(&state);
        }
        assert_eq!((tallies.repeated, tallies.backward), (1, 1));
    }
}
