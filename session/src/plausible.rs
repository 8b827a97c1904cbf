//! Findings about the values of joint states: efforts that are plain zeros, positions in degrees, a position that jumps,
//! a velocity that is not the derivative of the position, a pause. Memory does not grow with the samples.

use tauscope_archive::{JointFacts, JointTallies};
use tauscope_bus::{JointState, flags};
use tauscope_dynamics::{JointKind, Model};

use crate::assembler::Whole;
use crate::finding::{Finding, OddVelocity};

/// Samples that tell whether efforts are zero: fewer may be a driver that has only begun.
/// Resolution: two seconds at 100 Hz.
const TELLING_SAMPLES: u64 = 200;
/// A position further beyond the URDF's limit than this is no bend of a mechanical stop \[rad\].
/// Physical: arms are stopped by their controllers within a few degrees of the limit.
const BEYOND_RAD: f64 = 0.2;
/// Multiple of the URDF's limit from which positions of more than three turns are degrees.
/// Physical: a degree is 57 times as small as a radian, and an arm uses more than a tenth of its range.
const DEGREES: f64 = 4.0;
const THREE_TURNS: f64 = 6.0 * std::f64::consts::PI;
/// A pause that is worth a word \[ns\].
/// Physical: an arm may have come and gone in half a second.
const PAUSE_NS: i64 = 500_000_000;
/// Together all joints have moved less than this: the arm stands \[rad or m\].
/// Physical: a hundred steps of a coarse encoder for each of six joints.
const STANDS: f64 = 0.1;

/// Follows the joint states of a robot.
#[derive(Debug)]
pub struct Plausible {
    names: Vec<String>,
    /// By joint, the URDF's limits.
    limits: Vec<Option<[f64; 2]>>,
    values: JointTallies,
    samples: u64,
    first_ns: i64,
    last_ns: i64,
    /// The longest pause, and when it began \[ns\].
    pause_ns: (i64, i64),
}

impl Plausible {
    /// Of joints with these names, with the limits of `model`; nothing seen yet.
    pub fn new(names: &[String], model: Option<&Model>) -> Self {
        let names = names.to_vec();
        let joints = model.map_or(&[][..], Model::joints);
        let limits_of = |name: &String| {
            let joint = joints.iter().find(|joint| joint.name == *name)?;
            let turns = joint.kind == JointKind::Revolute;
            let limits = joint.limits.lower.zip(joint.limits.upper);
            limits
                .filter(|_| turns)
                .map(|(lower, upper)| [lower, upper])
        };
        Self {
            limits: names.iter().map(limits_of).collect(),
            values: JointTallies::in_order(&names),
            names,
            samples: 0,
            first_ns: 0,
            last_ns: 0,
            pause_ns: (0, 0),
        }
    }

    /// Takes a sample.
    pub fn add(&mut self, sample: &JointState) {
        let header = &sample.header;
        let count = self.names.len();
        let given = |flag| if header.has(flag) { count } else { 0 };
        let velocities = given(flags::VELOCITY_MEASURED);
        let efforts = given(flags::EFFORT_MEASURED);
        self.add_values(
            header.stamp_ns,
            &sample.position[..count],
            &sample.velocity[..velocities],
            &sample.effort[..efforts],
        );
    }

    /// Takes a state of `count` joints.
    pub fn add_whole(&mut self, whole: &Whole, count: usize) {
        let given = |given: bool| if given { count } else { 0 };
        self.add_values(
            whole.stamp_ns,
            &whole.position[..count],
            &whole.velocity[..given(whole.has_velocity)],
            &whole.effort[..given(whole.has_effort)],
        );
    }

    /// Takes the values of one instant, joints in the robot's order; empty slices for fields that are not given.
    pub fn add_values(
        &mut self,
        stamp_ns: i64,
        position: &[f64],
        velocity: &[f64],
        effort: &[f64],
    ) {
        self.values.add_values(stamp_ns, position, velocity, effort);
        if self.samples == 0 {
            self.first_ns = stamp_ns;
        } else {
            let pause_ns = stamp_ns - self.last_ns;
            if pause_ns > self.pause_ns.0 {
                self.pause_ns = (pause_ns, self.last_ns);
            }
        }
        self.last_ns = stamp_ns;
        self.samples += 1;
    }

    /// From the first to the newest sample \[s\].
    pub fn span_s(&self) -> f64 {
        (self.last_ns - self.first_ns) as f64 * 1e-9
    }

    /// Number of samples.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Whether no joint has moved.
    pub fn stands(&self) -> bool {
        let ranges = self.values.facts().into_iter();
        let ranges = ranges.filter_map(|facts| facts.position_range);
        ranges.map(|[low, high]| high - low).sum::<f64>() < STANDS
    }

    /// Findings so far.
    pub fn findings(&self) -> Vec<Finding> {
        let facts = self.values.facts();
        let mut all = Vec::new();
        let zero = facts.iter().filter(|facts| facts.effort_is_zero);
        let zero: Vec<String> = zero.map(|facts| facts.name.clone()).collect();
        if !zero.is_empty() && self.samples >= TELLING_SAMPLES {
            let is_all = zero.len() == facts.len();
            all.push(Finding::ZeroEffort {
                joints: zero,
                all: is_all,
            });
        }
        let named = || facts.iter().zip(&self.limits);
        let degrees = named().filter(|(facts, limits)| in_degrees(facts, **limits));
        let degrees: Vec<String> = degrees.map(|(facts, _)| facts.name.clone()).collect();
        let jumps = facts.iter().filter_map(|facts| {
            let (joint, remark) = (facts.name.clone(), facts.jump_remark()?);
            Some(Finding::Jump { joint, remark })
        });
        all.extend(jumps);
        if degrees.is_empty() {
            all.extend(named().filter_map(|(facts, limits)| beyond(facts, (*limits)?)));
            all.extend(odd_velocities(&facts, false));
        } else {
            all.push(Finding::Degrees { joints: degrees });
        }
        let (pause_ns, from_ns) = self.pause_ns;
        if pause_ns >= PAUSE_NS {
            all.push(Finding::Pause {
                duration_s: pause_ns as f64 * 1e-9,
                at_s: (from_ns - self.first_ns) as f64 * 1e-9,
            });
        }
        all
    }
}

/// The finding about joints whose velocity is not the derivative of the position.
pub(crate) fn odd_velocities(facts: &[JointFacts], is_replaced: bool) -> Option<Finding> {
    let odd = facts.iter().filter(|facts| facts.has_odd_velocity());
    let joints: Vec<OddVelocity> = odd
        .filter_map(|facts| {
            Some(OddVelocity {
                joint: facts.name.clone(),
                slope: facts.velocity_slope?,
                constant: facts.constant_velocity,
            })
        })
        .collect();
    (!joints.is_empty()).then_some(Finding::Velocity {
        all: joints.len() == facts.len(),
        joints,
        is_replaced,
    })
}

/// Whether a joint's positions are in degrees: told by its velocities, or by the robot's limits.
fn in_degrees(facts: &JointFacts, limits: Option<[f64; 2]>) -> bool {
    let far = |[low, high]: [f64; 2], [lower, upper]: [f64; 2]| {
        high.max(-low) > THREE_TURNS.max(DEGREES * upper.max(-lower))
    };
    // A jump is no motion of the arm.
    let range = facts.position_range.filter(|_| facts.jumps.is_empty());
    let told = range.zip(limits);
    facts.is_in_degrees() || told.is_some_and(|(range, limits)| far(range, limits))
}

fn beyond(facts: &JointFacts, limits: [f64; 2]) -> Option<Finding> {
    let [low, high] = facts.position_range.filter(|_| facts.jumps.is_empty())?;
    let [lower, upper] = limits;
    let (below, above) = (lower - low, high - upper);
    (below.max(above) > BEYOND_RAD).then(|| Finding::BeyondLimits {
        joint: facts.name.clone(),
        position: if above > below { high } else { low },
        limits,
    })
}
