//! Anomalies in the joint states of a recording by joint, found in one pass with bounded memory.

mod jumps;
mod not_finite;
mod twice;

use serde::Serialize;

use crate::ros::JointState;
pub use jumps::Jump;
use jumps::{Jumps, Span};
pub use not_finite::{FIELDS, FieldTally, NotFinite};
pub use twice::Twice;
use twice::TwiceTally;

/// Minimum span over which a change of position is compared with the integral of the velocity \[ns\].
/// Physical: ten samples at 100 Hz, so that an encoder's step is small compared with the motion.
const SPAN_NS: i64 = 100_000_000;
/// Shortest pause between two samples that restarts the comparison \[ns\].
/// Physical: an arm may move away and back within half a second.
const PAUSE_NS: i64 = 500_000_000;
/// Minimum travel of a joint for its velocity to be compared with its position \[rad or m\].
/// Physical: a hundred steps of a coarse encoder of 6000 steps per turn.
const TELLING_MOTION: f64 = 0.1;
/// Relative error above which a velocity is reported as inconsistent with the position.
/// Physical: low-passed velocities of real drives keep within 5 % of the derivative over 0.1 s.
const ODD_SHARE: f64 = 0.1;
/// Ratio of the velocity to the derivative of the position if positions are in degrees and velocities in rad/s.
const RADIANS_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Summary of a joint over all messages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFacts {
    /// Its name.
    pub name: String,
    /// Smallest and largest position \[rad or m\].
    pub position_range: Option<[f64; 2]>,
    /// Slope of the recorded velocity over the derivative of the position; 1 if they are consistent. `None` if the
    /// joint moves too little or has more jumps than are listed.
    pub velocity_slope: Option<f64>,
    /// The velocity, if it is the same in all messages \[rad/s or m/s\]; -0 is reported as 0.
    pub constant_velocity: Option<f64>,
    /// Total travel \[rad or m\]; 0 where velocities or positions are missing.
    pub travel: f64,
    /// Whether efforts are given and all of them are 0.
    pub effort_is_zero: bool,
    /// Whether no message gives a finite effort.
    pub lacks_effort: bool,
    /// Values that are NaN or infinite, by field.
    pub not_finite: Vec<NotFinite>,
    /// Changes of the position that the velocity does not explain, in the order of time.
    pub jumps: Vec<Jump>,
    /// Whether there are more jumps than are listed; [`Self::velocity_slope`] is then `None`.
    pub more_jumps: bool,
}

impl JointFacts {
    /// Returns whether the positions are in degrees, judged by the velocities.
    pub fn is_in_degrees(&self) -> bool {
        let slope = self.velocity_slope;
        slope.is_some_and(|slope| (slope / RADIANS_PER_DEGREE - 1.0).abs() < ODD_SHARE)
    }

    /// Describes the jumps of its position.
    pub fn jump_remark(&self) -> Option<String> {
        let (first, others) = self.jumps.split_first()?;
        let mut text = format!("the position of {} jumps {}", self.name, first.in_words());
        let at_least = if self.more_jumps { "at least " } else { "" };
        match others.len() {
            0 => {}
            1 => text += "; it does so once more",
            more => text += &format!("; it does so {at_least}{more} more times"),
        }
        Some(text)
    }

    /// Returns whether the velocity is inconsistent with the derivative of the position.
    pub fn has_odd_velocity(&self) -> bool {
        let slope = self.velocity_slope;
        slope.is_some_and(|slope| (slope - 1.0).abs() > ODD_SHARE)
    }
}

/// Accumulates the facts about the joints of one topic. Its memory depends on the number of joints only. The order of
/// the joints may differ between messages.
#[derive(Debug, Default)]
pub struct JointTallies {
    joints: Vec<JointTally>,
    last: Option<JointState>,
    /// Number of messages that repeat the values of the preceding message.
    pub repeated: u64,
    /// Number of messages with an earlier stamp than the preceding message.
    pub backward: u64,
    twice: TwiceTally,
    /// Stamp of the first message \[ns\].
    first_ns: Option<i64>,
}

/// Accumulator of one joint.
#[derive(Debug)]
struct JointTally {
    name: String,
    range: Option<[f64; 2]>,
    efforts: u64,
    zeros: u64,
    /// Position and stamp \[ns\] at the start of the current span.
    from: Option<(f64, i64)>,
    before: Option<Before>,
    /// Integral of the velocity over the current span.
    integral: f64,
    /// Smallest and largest velocity.
    velocity_range: Option<[f64; 2]>,
    /// Sums over spans without a suspected jump.
    sums: Span,
    jumps: Jumps,
    fields: [FieldTally; 3],
}

/// The preceding sample.
#[derive(Debug, Clone, Copy)]
struct Before {
    position: f64,
    velocity: f64,
    stamp_ns: i64,
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
            velocity_range: None,
            sums: Span::default(),
            jumps: Jumps::default(),
            fields: <_>::default(),
        }
    }

    /// Adds a sample of position, velocity and effort; `None` for a value that is not given.
    fn add(&mut self, stamp_ns: i64, values: [Option<f64>; 3]) {
        for (field, value) in self.fields.iter_mut().zip(values) {
            if let Some(value) = value {
                field.add(stamp_ns, value);
            }
        }
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
        let [low, high] = self.velocity_range.unwrap_or([velocity; 2]);
        self.velocity_range = Some([low.min(velocity), high.max(velocity)]);
        let step_ns = self.before.map(|before| stamp_ns - before.stamp_ns);
        match (self.before, step_ns, self.from) {
            (Some(before), Some(step_ns), Some((from, from_ns)))
                if (0..PAUSE_NS).contains(&step_ns) =>
            {
                let step = 0.5 * (before.velocity + velocity) * step_ns as f64 * 1e-9;
                self.integral += step;
                let miss = position - before.position - step;
                self.jumps.step(stamp_ns, step_ns, miss);
                if stamp_ns - from_ns >= SPAN_NS {
                    let change = position - from;
                    let ended = self.jumps.end_span(Span {
                        squares: change * change,
                        products: change * self.integral,
                        moved: change.abs(),
                    });
                    self.sums.add(&ended.unwrap_or_default());
                    self.from = Some((position, stamp_ns));
                    self.integral = 0.0;
                }
            }
            _ => {
                self.jumps.begin_span();
                self.from = Some((position, stamp_ns));
                self.integral = 0.0;
            }
        }
        self.before = Some(Before {
            position,
            velocity,
            stamp_ns,
        });
    }

    /// Returns the facts, with times relative to `first_ns`.
    fn facts(&self, first_ns: i64) -> JointFacts {
        let mut sums = self.sums;
        sums.add(&self.jumps.without_jump());
        let (jumps, more_jumps) = self.jumps.found(first_ns);
        let tells = sums.moved > TELLING_MOTION && !more_jumps;
        let fields = self.fields.iter().zip(FIELDS);
        JointFacts {
            name: self.name.clone(),
            position_range: self.range,
            velocity_slope: tells.then(|| sums.products / sums.squares),
            constant_velocity: (self.velocity_range)
                .and_then(|[low, high]| (high - low == 0.0).then_some(low + 0.0)),
            travel: sums.moved,
            lacks_effort: self.efforts == 0,
            effort_is_zero: self.efforts > 0 && self.zeros == self.efforts,
            not_finite: fields
                .filter_map(|(tally, field)| tally.found(field, first_ns))
                .collect(),
            jumps,
            more_jumps,
        }
    }
}

impl JointTallies {
    /// Adds a message.
    pub fn add(&mut self, state: &JointState) {
        let stamp_ns = state.header.stamp.ns();
        self.first_ns.get_or_insert(stamp_ns);
        let last = self.last.as_ref();
        let is_like_before = last.is_some_and(|last| last.name == state.name);
        self.twice.add(state, is_like_before);
        if let Some(last) = last {
            let same = is_like_before
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

    /// Creates the tallies for samples whose joints are always in the order of `names`.
    pub fn in_order(names: &[String]) -> Self {
        let joints = names.iter().map(|name| JointTally::new(name)).collect();
        Self {
            joints,
            ..Self::default()
        }
    }

    /// Adds the values of one instant. A slice is empty if the source does not give its quantity.
    pub fn add_values(
        &mut self,
        stamp_ns: i64,
        position: &[f64],
        velocity: &[f64],
        effort: &[f64],
    ) {
        self.first_ns.get_or_insert(stamp_ns);
        for (at, joint) in self.joints.iter_mut().enumerate() {
            let of = |values: &[f64]| values.get(at).copied();
            joint.add(stamp_ns, [of(position), of(velocity), of(effort)]);
        }
    }

    /// Messages that name a joint more than once, and the first of these joints.
    pub fn twice(&self) -> Option<&Twice> {
        self.twice.found.as_ref()
    }

    fn place(&mut self, name: &str) -> usize {
        let known = self.joints.iter().position(|joint| joint.name == name);
        known.unwrap_or_else(|| {
            self.joints.push(JointTally::new(name));
            self.joints.len() - 1
        })
    }

    /// Returns the facts about each joint, in the order of appearance.
    pub fn facts(&self) -> Vec<JointFacts> {
        let first_ns = self.first_ns.unwrap_or(0);
        let joints = self.joints.iter();
        joints.map(|joint| joint.facts(first_ns)).collect()
    }
}

#[cfg(test)]
mod tests;
