//! Assembly of the state of all joints from one message or several.

use tauscope_archive::{FIELDS, FieldTally, NotFinite, ros};
use tauscope_bus::{JointArray, MAX_JOINTS};

use super::layout::Layout;
use crate::clock::Clock;

/// Time between parts of a state above which one of the publishers has stopped \[ns\].
/// Resolution: longer than the difference between two rates of one robot, short compared with what a person notices.
const APART_NS: i64 = 500_000_000;

/// A state of all joints, in the robot's order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Whole {
    /// Time of its newest part \[ns\].
    pub stamp_ns: i64,
    /// Positions \[rad or m\].
    pub position: JointArray,
    /// Velocities \[rad/s or m/s\]; zeros without `has_velocity`.
    pub velocity: JointArray,
    /// Efforts in the recording's unit; zeros without `has_effort`.
    pub effort: JointArray,
    /// Whether all parts gave positions.
    pub has_position: bool,
    /// Whether all parts gave velocities.
    pub has_velocity: bool,
    /// Whether all parts gave efforts, and none of them dropped to zero.
    pub has_effort: bool,
}

impl Whole {
    /// Whether all values of the first `joint_count` joints are finite.
    pub fn is_finite(&self, joint_count: usize) -> bool {
        [&self.position, &self.velocity, &self.effort]
            .iter()
            .all(|array| array[..joint_count].iter().all(|value| value.is_finite()))
    }
}

/// The parts of a state that have arrived.
#[derive(Debug)]
pub struct Gather {
    all: u32,
    seen: u32,
    parts: Whole,
    /// Reception times of the first and the newest of these parts, and the number of messages replaced by a newer
    /// one.
    since_ns: i64,
    newest_ns: i64,
    replaced: u64,
    /// Replaced messages of states that were completed too late.
    in_vain: u64,
    /// Number of non-finite values of position, velocity and effort, by joint.
    fields: Vec<[FieldTally; 3]>,
    /// Stamp of the first message \[ns\].
    first_ns: Option<i64>,
    /// Number of non-finite values.
    bad: u64,
}

const NOTHING: Whole = Whole {
    stamp_ns: 0,
    position: [0.0; MAX_JOINTS],
    velocity: [0.0; MAX_JOINTS],
    effort: [0.0; MAX_JOINTS],
    has_position: true,
    has_velocity: true,
    has_effort: true,
};

impl Gather {
    /// Creates an empty assembly of at most 16 joints.
    pub fn new(joint_count: usize) -> Self {
        Self {
            all: u32::MAX.checked_shr(32 - joint_count as u32).unwrap_or(0),
            seen: 0,
            parts: NOTHING,
            since_ns: 0,
            newest_ns: 0,
            replaced: 0,
            in_vain: 0,
            fields: vec![<_>::default(); joint_count],
            first_ns: None,
            bad: 0,
        }
    }

    /// Adds a message; returns the state once every joint has a value. Its stamp is that of its newest part. It has a
    /// velocity or effort if all parts have one. `lacks_effort` states that the message's efforts are not
    /// measurements.
    pub fn add(
        &mut self,
        layout: &Layout,
        message: &ros::JointState,
        (stamp_ns, received_ns): (i64, i64),
        lacks_effort: bool,
    ) -> Option<Whole> {
        if self.seen == 0 {
            self.parts = NOTHING;
            self.since_ns = received_ns;
            self.replaced = 0;
        } else if self.seen & layout.joints != 0 {
            self.replaced += 1;
        }
        self.seen |= layout.joints;
        self.newest_ns = received_ns;
        self.first_ns.get_or_insert(stamp_ns);
        let parts = &mut self.parts;
        parts.stamp_ns = parts.stamp_ns.max(stamp_ns);
        parts.has_position &= !message.position.is_empty();
        parts.has_velocity &= !message.velocity.is_empty();
        parts.has_effort &= !message.effort.is_empty() && !lacks_effort;
        let fields = [
            (&message.position, &mut parts.position),
            (&message.velocity, &mut parts.velocity),
            (&message.effort, &mut parts.effort),
        ];
        for (field, (values, target)) in fields.into_iter().enumerate() {
            for (&value, place) in values.iter().zip(&layout.places) {
                let Some(j) = *place else { continue };
                target[j] = value;
                self.fields[j][field].add(stamp_ns, value);
                self.bad += u64::from(!value.is_finite());
            }
        }
        if self.seen & self.all != self.all {
            return None;
        }
        self.in_vain = self.in_vain();
        self.seen = 0;
        // A field that only some parts have is discarded.
        if !self.parts.has_velocity {
            self.parts.velocity = [0.0; MAX_JOINTS];
        }
        if !self.parts.has_effort {
            self.parts.effort = [0.0; MAX_JOINTS];
        }
        Some(self.parts)
    }

    /// Returns the number of messages that completed no state because a joint was missing for a long time.
    pub fn in_vain(&self) -> u64 {
        let waits = self.seen != 0 && self.newest_ns - self.since_ns > APART_NS;
        self.in_vain + if waits { self.replaced } else { 0 }
    }

    /// Returns the first joint and field that was present and never finite.
    pub fn never_finite(&self) -> Option<(usize, &'static str)> {
        (0..FIELDS.len()).find_map(|field| {
            let mut joints = self.fields.iter();
            let joint = joints.position(|fields| fields[field].is_never_finite())?;
            Some((joint, FIELDS[field]))
        })
    }

    /// Returns the number of non-finite values.
    pub fn bad(&self) -> u64 {
        self.bad
    }

    /// Returns the non-finite values by joint and field; times are relative to the first message.
    pub fn not_finite(&self) -> impl Iterator<Item = (usize, NotFinite)> {
        let first_ns = self.first_ns.unwrap_or(0);
        let joints = self.fields.iter().enumerate();
        joints.flat_map(move |(joint, fields)| {
            let fields = fields.iter().zip(FIELDS);
            fields.filter_map(move |(tally, field)| Some((joint, tally.found(field, first_ns)?)))
        })
    }
}

/// Returns the header's stamp, or the time of reception if the publisher left the stamp at zero \[ns\].
pub fn stamp_of(header: &ros::Header, received_ns: i64) -> i64 {
    Clock::StampsOrReception.time_ns(header.stamp.ns(), received_ns)
}
