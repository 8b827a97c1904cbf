//! What cannot be in joint states: efforts that are plain zeros, positions in degrees, a position that jumps, a
//! velocity that is not the derivative of the position, a pause. Whoever reads joint states asks it, and says it: `run` while they come,
//! `replay` and `calibrate` of each recording. Memory does not grow with the samples.

mod twin;
mod watched;

use std::fmt;

use tauscope_archive::{JointFacts, JointTallies};
use tauscope_bus::{JointState, flags};
use tauscope_dynamics::JointKind;

use crate::cell::Cell;
use crate::suggest;

pub use twin::{PlausibleTwin, cutoff_above_half, cutoffs_above_half, recorded_rate_hz};
pub use watched::{Watched, WatchedTwin};

/// Samples that tell whether efforts are zero: fewer may be a driver that has only begun.
/// Resolution: two seconds at 100 Hz.
const TELLING_SAMPLES: u64 = 200;
/// A position further beyond the URDF's limit than this is no bend of a mechanical stop \[rad\].
/// Physical: arms are stopped by their controllers within a few degrees of the limit.
const BEYOND_RAD: f64 = 0.2;
/// Positions of more than so many times the URDF's limit, and of more than three turns, are degrees.
/// Physical: a degree is 57 times as small as a radian, and an arm uses more than a tenth of its range.
const DEGREES: f64 = 4.0;
const THREE_TURNS: f64 = 6.0 * std::f64::consts::PI;
/// A pause that is worth a word \[ns\].
/// Physical: an arm may have come and gone in half a second.
const PAUSE_NS: i64 = 500_000_000;
/// Together all joints have moved less than this: the arm stands \[rad or m\].
/// Physical: a hundred steps of a coarse encoder for each of six joints.
const STANDS: f64 = 0.1;

/// Something that cannot be, or is odd.
#[derive(Debug, Clone, PartialEq)]
pub enum Oddity {
    /// All efforts of these joints are zero.
    ZeroEffort {
        /// They.
        joints: Vec<String>,
        /// Whether these are all joints.
        all: bool,
    },
    /// The positions of these joints are in degrees.
    Degrees {
        /// They.
        joints: Vec<String>,
    },
    /// A joint is beyond what the URDF allows.
    Beyond {
        /// It.
        joint: String,
        /// The position furthest beyond \[rad or m\].
        position: f64,
        /// The limits \[rad or m\].
        limits: [f64; 2],
    },
    /// A velocity is not the derivative of the position: what [`JointFacts::remark`] says.
    Velocity {
        /// The joint.
        joint: String,
        /// What is odd.
        remark: String,
    },
    /// A position changes by more than its velocity explains: what [`JointFacts::jump_remark`] says.
    Jump {
        /// The joint.
        joint: String,
        /// Where and how large.
        remark: String,
    },
    /// The longest pause.
    Pause {
        /// How long \[s\].
        duration_s: f64,
        /// From the first sample to its beginning \[s\].
        at_s: f64,
    },
}

impl Oddity {
    /// What it is about: of two with the same one, the later is not worth a second word.
    fn key(&self) -> String {
        match self {
            Self::ZeroEffort { .. } => "effort".to_owned(),
            Self::Degrees { .. } => "degrees".to_owned(),
            Self::Pause { .. } => "pause".to_owned(),
            Self::Beyond { joint, .. } => format!("limits of {joint}"),
            Self::Velocity { joint, .. } => format!("velocity of {joint}"),
            Self::Jump { joint, .. } => format!("jump of {joint}"),
        }
    }

    /// Whether nothing that is learnt from such data can be right.
    pub fn is_fault(&self) -> bool {
        matches!(
            self,
            Self::ZeroEffort { all: true, .. } | Self::Degrees { .. }
        )
    }
}

impl fmt::Display for Oddity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ZeroEffort { all: true, .. } => {
                f.write_str("the effort is zero throughout: the driver does not publish it")
            }
            Self::ZeroEffort { joints, .. } => write!(
                f,
                "the effort of {} is zero throughout: the driver does not publish it",
                suggest::some(&names(joints))
            ),
            Self::Degrees { joints } => write!(
                f,
                "the positions of {} are in degrees: publish radians",
                suggest::some(&names(joints))
            ),
            Self::Beyond {
                joint,
                position,
                limits: [lower, upper],
            } => write!(
                f,
                "the position of {joint} reaches {position:.2}, beyond the URDF's limits of {lower:.2} and {upper:.2}"
            ),
            Self::Velocity { remark, .. } | Self::Jump { remark, .. } => f.write_str(remark),
            Self::Pause { duration_s, at_s } => {
                write!(f, "a gap of {duration_s:.3} s at {at_s:.3} s")
            }
        }
    }
}

fn names(joints: &[String]) -> Vec<&str> {
    joints.iter().map(String::as_str).collect()
}

/// Follows the joint states of a cell.
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
    /// Nothing seen yet.
    pub fn new(cell: &Cell) -> Self {
        let names = cell.facts.joint_names.clone();
        let joints = cell.model.as_ref().map_or(&[][..], |model| model.joints());
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
        self.values.add_values(
            header.stamp_ns,
            &sample.position[..count],
            &sample.velocity[..velocities],
            &sample.effort[..efforts],
        );
        if self.samples == 0 {
            self.first_ns = header.stamp_ns;
        } else {
            let pause_ns = header.stamp_ns - self.last_ns;
            if pause_ns > self.pause_ns.0 {
                self.pause_ns = (pause_ns, self.last_ns);
            }
        }
        self.last_ns = header.stamp_ns;
        self.samples += 1;
    }

    /// From the first to the newest sample \[s\].
    pub fn span_s(&self) -> f64 {
        (self.last_ns - self.first_ns) as f64 * 1e-9
    }

    /// Whether no joint has moved.
    pub fn stands(&self) -> bool {
        let ranges = self.values.facts().into_iter();
        let ranges = ranges.filter_map(|facts| facts.position_range);
        ranges.map(|[low, high]| high - low).sum::<f64>() < STANDS
    }

    /// What is odd so far.
    pub fn oddities(&self) -> Vec<Oddity> {
        let facts = self.values.facts();
        let mut all = Vec::new();
        let zero = facts.iter().filter(|facts| facts.effort_is_zero);
        let zero: Vec<String> = zero.map(|facts| facts.name.clone()).collect();
        if !zero.is_empty() && self.samples >= TELLING_SAMPLES {
            let is_all = zero.len() == facts.len();
            all.push(Oddity::ZeroEffort {
                joints: zero,
                all: is_all,
            });
        }
        let named = || facts.iter().zip(&self.limits);
        let degrees = named().filter(|(facts, limits)| in_degrees(facts, **limits));
        let degrees: Vec<String> = degrees.map(|(facts, _)| facts.name.clone()).collect();
        let jumps = facts.iter().filter_map(|facts| {
            let (joint, remark) = (facts.name.clone(), facts.jump_remark()?);
            Some(Oddity::Jump { joint, remark })
        });
        all.extend(jumps);
        if degrees.is_empty() {
            all.extend(named().filter_map(|(facts, limits)| beyond(facts, (*limits)?)));
            let remarks = facts.iter().filter_map(|facts| {
                let (joint, remark) = (facts.name.clone(), facts.remark()?);
                Some(Oddity::Velocity { joint, remark })
            });
            all.extend(remarks);
        } else {
            all.push(Oddity::Degrees { joints: degrees });
        }
        let (pause_ns, from_ns) = self.pause_ns;
        if pause_ns >= PAUSE_NS {
            all.push(Oddity::Pause {
                duration_s: pause_ns as f64 * 1e-9,
                at_s: (from_ns - self.first_ns) as f64 * 1e-9,
            });
        }
        all
    }
}

/// Whether a joint's positions are in degrees: told by its velocities, or by the robot's limits.
fn in_degrees(facts: &JointFacts, limits: Option<[f64; 2]>) -> bool {
    let far = |[low, high]: [f64; 2], [lower, upper]: [f64; 2]| {
        high.max(-low) > THREE_TURNS.max(DEGREES * upper.max(-lower))
    };
    // Where it jumped to is no motion of the arm.
    let range = facts.position_range.filter(|_| facts.jumps.is_empty());
    let told = range.zip(limits);
    facts.is_in_degrees() || told.is_some_and(|(range, limits)| far(range, limits))
}

fn beyond(facts: &JointFacts, limits: [f64; 2]) -> Option<Oddity> {
    let [low, high] = facts.position_range.filter(|_| facts.jumps.is_empty())?;
    let [lower, upper] = limits;
    let (below, above) = (lower - low, high - upper);
    (below.max(above) > BEYOND_RAD).then(|| Oddity::Beyond {
        joint: facts.name.clone(),
        position: if above > below { high } else { low },
        limits,
    })
}
