//! Packing: from messages of several topics to one sample an instant. Pure: no clock, no I/O.
//!
//! Joints are brought into the cell's order by name, parts of a state that several publishers send
//! are put together, a missing velocity is differentiated, and each sample takes with it the newest
//! command, the newest effort of another twin and the tool, at or before its stamp. A sample waits a
//! little for these, so that the result does not depend on which of two messages was faster.

mod differentiate;
mod gather;
mod layout;
mod order;
mod outcome;
mod refused;
mod side;

use std::collections::VecDeque;

use tauscope_archive::ros;
use tauscope_bus::{Header, JointArray, JointState, MAX_JOINTS, flags};
use tauscope_dynamics::Unwrap;

use crate::config::ConfigError;
use crate::setup::{Setup, Tool};
use differentiate::Differentiator;
use gather::{Gather, Gathered, stamp_of};
use layout::Layouts;
use order::{Next, Order};
pub use outcome::{PackCounts, PackError};
use refused::Told;
use side::Side;

/// Samples that wait for their command at most.
/// Resolution: memory; about 1 s at 1 kHz.
const MAX_PENDING: usize = 1024;

/// How samples are packed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PackSettings {
    /// Low-pass on positions before they are differentiated \[Hz\].
    pub velocity_cutoff_hz: f64,
    /// Older commands and efforts of another twin do not belong to a sample \[ns\].
    pub max_age_ns: i64,
    /// How long a sample waits for the command and the other twin's effort of its instant, in time of
    /// reception \[ns\].
    pub wait_ns: i64,
    /// Whether commands are to be waited for.
    pub expects_command: bool,
    /// Whether another twin's efforts are to be waited for.
    pub expects_reference: bool,
}

/// Packs messages into samples.
#[derive(Debug)]
pub struct Packer {
    settings: PackSettings,
    joint_count: usize,
    layouts: Layouts,
    state: Gather,
    command: Gather,
    reference: Gather,
    /// Whole turns that the driver has taken off, of measured and of commanded positions.
    turns: [[Unwrap; MAX_JOINTS]; 2],
    state_velocity: Differentiator,
    command_velocity: Differentiator,
    commands: Side<Command>,
    references: Side<JointArray>,
    tools: Side<Option<Tool>>,
    fixed_tool: Option<Tool>,
    /// Somebody has asked for learning since the newest sample.
    learning_asked: bool,
    /// Commands of a recording that no sample has taken yet.
    told: VecDeque<tauscope_bus::Command>,
    pending: VecDeque<JointState>,
    order: Order,
    flushed: bool,
    messages: u64,
    counts: PackCounts,
    /// The first joint that a message names more than once.
    twice: Option<(usize, [usize; 2])>,
    told_refused: Told,
}

#[derive(Debug, Clone, Copy)]
enum Topic {
    State,
    Command,
    Reference,
}

#[derive(Debug, Clone, Copy)]
struct Command {
    position: JointArray,
    velocity: JointArray,
    velocity_given: bool,
}

impl Packer {
    /// A packer for a cell.
    ///
    /// # Errors
    /// If a sample has no room for so many joints.
    pub fn new(setup: &Setup, settings: PackSettings) -> Result<Self, ConfigError> {
        let joint_count = setup.joint_names.len();
        if joint_count > MAX_JOINTS {
            return Err(ConfigError::TooManyJoints {
                found: joint_count,
                limit: MAX_JOINTS,
            });
        }
        let differentiator = || Differentiator::new(joint_count, settings.velocity_cutoff_hz);
        Ok(Self {
            settings,
            joint_count,
            layouts: Layouts::new(&setup.joint_names),
            state: Gather::new(joint_count),
            command: Gather::new(joint_count),
            reference: Gather::new(joint_count),
            turns: <[[Unwrap; MAX_JOINTS]; 2]>::default(),
            state_velocity: differentiator(),
            command_velocity: differentiator(),
            commands: Side::default(),
            references: Side::default(),
            tools: Side::default(),
            fixed_tool: setup.tool,
            learning_asked: false,
            told: VecDeque::new(),
            pending: VecDeque::new(),
            order: Order::default(),
            flushed: false,
            messages: 0,
            counts: PackCounts::default(),
            twice: None,
            told_refused: Told::default(),
        })
    }

    /// What it has counted.
    pub fn counts(&self) -> PackCounts {
        PackCounts {
            parted: self.state.in_vain(),
            ..self.counts
        }
    }

    /// Which of the cell's joints a message names: bit j is joint j.
    pub(crate) fn joints_of(&mut self, message: &ros::JointState) -> u32 {
        self.layouts.of(&message.name).joints
    }

    /// Takes a measured state that was received at `received_ns`.
    pub fn state(&mut self, message: &ros::JointState, received_ns: i64) {
        self.messages += 1;
        let Some(whole) = self.gather(Topic::State, message, received_ns) else {
            return;
        };
        if whole.has_position {
            self.sample(&whole, received_ns);
        } else {
            self.counts.incomplete += 1;
        }
    }

    /// Takes a command.
    pub fn command(&mut self, message: &ros::JointState, received_ns: i64) {
        let Some(whole) = self.gather(Topic::Command, message, received_ns) else {
            return;
        };
        if !whole.has_position {
            self.counts.incomplete += 1;
            return;
        }
        let position = self.unwrapped(Topic::Command, &whole);
        let differentiated = self.command_velocity.update(
            whole.stamp_ns,
            &position,
            whole.has_velocity.then_some(&whole.velocity),
        );
        let command = Command {
            position,
            velocity: differentiated.velocity,
            velocity_given: whole.has_velocity,
        };
        self.commands.push(whole.stamp_ns, command);
    }

    /// Takes the effort that another twin computed.
    pub fn reference(&mut self, message: &ros::JointState, received_ns: i64) {
        let Some(whole) = self.gather(Topic::Reference, message, received_ns) else {
            return;
        };
        if whole.has_effort {
            self.references.push(whole.stamp_ns, whole.effort);
        } else {
            self.counts.incomplete += 1;
        }
    }

    /// Takes the tool that is attached from now on; mass 0 means none.
    pub fn tool(&mut self, message: &ros::InertiaStamped, received_ns: i64) {
        let inertia = &message.inertia;
        let tool = Tool {
            mass_kg: inertia.m,
            com_m: [inertia.com.x, inertia.com.y, inertia.com.z],
            inertia_kgm2: [
                inertia.ixx,
                inertia.ixy,
                inertia.ixz,
                inertia.iyy,
                inertia.iyz,
                inertia.izz,
            ],
        };
        if !tool.is_finite() {
            self.counts.not_finite += 1;
            return;
        }
        let stamp_ns = stamp_of(&message.header, received_ns);
        self.tools
            .push(stamp_ns, (tool.mass_kg > 0.0).then_some(tool));
    }

    /// Takes a request that the detectors learn anew: it belongs to the state that comes next, for it
    /// has no stamp of its own.
    pub fn learn(&mut self, message: ros::Bool) {
        self.learning_asked |= message.data;
    }

    /// Takes a command of a recording: it belongs to the state that comes next.
    pub fn told(&mut self, command: tauscope_bus::Command) {
        if self.told.len() < MAX_PENDING {
            self.told.push_back(command);
        }
    }

    /// Gives out the next sample that need not wait any longer; `now_ns` is the present on the clock
    /// of reception (the time of the newest message, where nothing is live).
    pub fn pop(&mut self, now_ns: i64) -> Option<JointState> {
        self.is_due(now_ns).then(|| {
            let mut sample = JointState::default();
            self.pop_into(&mut sample);
            sample
        })
    }

    /// Whether [`Packer::pop`] has one.
    pub fn is_due(&self, now_ns: i64) -> bool {
        self.pending.front().is_some_and(|front| {
            let stamp_ns = front.header.stamp_ns;
            let complete = (!self.settings.expects_command || self.commands.reaches(stamp_ns))
                && (!self.settings.expects_reference || self.references.reaches(stamp_ns));
            // A clock of reception that was set back does not make it wait for ever.
            let waited_ns = now_ns.saturating_sub(front.header.received_ns);
            let waited = waited_ns.saturating_abs() >= self.settings.wait_ns;
            complete || waited || self.flushed || self.pending.len() >= MAX_PENDING
        })
    }

    /// Gives out the sample that is due, in its place.
    pub fn pop_into(&mut self, sample: &mut JointState) {
        if let Some(front) = self.pending.front() {
            *sample = *front;
            self.pending.pop_front();
            self.attach(sample);
            self.counts.packed += 1;
        }
    }

    /// Whether a sample waits.
    pub fn is_waiting(&self) -> bool {
        !self.pending.is_empty()
    }

    /// No message will follow: nothing waits any longer.
    pub fn flush(&mut self) {
        self.flushed = true;
    }

    /// Adds a message to what its topic brought; gives the state of all joints once it is whole.
    fn gather(
        &mut self,
        topic: Topic,
        message: &ros::JointState,
        received_ns: i64,
    ) -> Option<Gathered> {
        let layout = self.layouts.of(&message.name);
        if layout.joints == 0 {
            self.counts.foreign += 1;
            return None;
        }
        if let Some(twice) = layout.twice {
            self.counts.ambiguous += 1;
            self.twice.get_or_insert(twice);
            return None;
        }
        let gather = match topic {
            Topic::State => &mut self.state,
            Topic::Command => &mut self.command,
            Topic::Reference => &mut self.reference,
        };
        let whole = gather.add(layout, message, received_ns)?;
        if !whole.is_finite(self.joint_count) {
            self.counts.not_finite += 1;
            return None;
        }
        Some(whole)
    }

    /// Positions without the wraps of the driver.
    fn unwrapped(&mut self, topic: Topic, whole: &Gathered) -> JointArray {
        let mut position = whole.position;
        let turns = &mut self.turns[usize::from(matches!(topic, Topic::Command))];
        for (position, turns) in position.iter_mut().zip(turns).take(self.joint_count) {
            *position = turns.next(whole.stamp_ns, *position);
        }
        position
    }

    /// Puts a whole state among the samples that wait.
    fn sample(&mut self, whole: &Gathered, received_ns: i64) {
        let mut flags = flags::EFFORT_MEASURED * u32::from(whole.has_effort)
            + flags::VELOCITY_MEASURED * u32::from(whole.has_velocity);
        match self.order.next(whole) {
            Next::Follows => {}
            Next::SetBack => {
                self.counts.resets += 1;
                self.turns = Default::default();
                self.state_velocity.reset();
                flags |= flags::RESET;
            }
            Next::Late => return self.counts.late += 1,
            Next::Repeated => return self.counts.repeated += 1,
            Next::Stalled => return self.counts.stalled += 1,
        }
        let position = self.unwrapped(Topic::State, whole);
        let differentiated = self.state_velocity.update(
            whole.stamp_ns,
            &position,
            whole.has_velocity.then_some(&whole.velocity),
        );
        if differentiated.restarted && self.counts.packed + self.pending.len() as u64 > 0 {
            flags |= flags::RESET;
        }
        if std::mem::take(&mut self.learning_asked) {
            flags |= flags::LEARN;
        }
        self.pending.push_back(JointState {
            header: Header {
                stamp_ns: whole.stamp_ns,
                received_ns,
                sequence: 0,
                flags,
                joint_count: self.joint_count as u32,
            },
            position,
            velocity: differentiated.velocity,
            effort: whole.effort,
            command: self.told.pop_front().unwrap_or_default(),
            ..JointState::default()
        });
    }

    /// Adds what belongs to the sample's instant.
    fn attach(&mut self, sample: &mut JointState) {
        let stamp_ns = sample.header.stamp_ns;
        if sample.header.has(flags::RESET) {
            self.commands.forget_after(stamp_ns);
            self.references.forget_after(stamp_ns);
            self.tools.forget_after(stamp_ns);
        }
        let max_age_ns = self.settings.max_age_ns;
        if let Some(command) = self.commands.at(stamp_ns, max_age_ns) {
            sample.command_position = command.position;
            sample.command_velocity = command.velocity;
            sample.header.flags |= flags::COMMAND;
            if command.velocity_given {
                sample.header.flags |= flags::COMMAND_VELOCITY;
            }
        }
        if let Some(effort) = self.references.at(stamp_ns, max_age_ns) {
            sample.reference_effort = *effort;
            sample.header.flags |= flags::REFERENCE;
        }
        // A tool stays until another is told of, however long that takes.
        let tool = match self.tools.at(stamp_ns, i64::MAX) {
            Some(told) => *told,
            None => self.fixed_tool,
        };
        if let Some(tool) = tool {
            sample.tool_mass_kg = tool.mass_kg;
            sample.tool_com_m = tool.com_m;
            sample.tool_inertia_kgm2 = tool.inertia_kgm2;
            sample.header.flags |= flags::TOOL;
        }
    }
}

#[cfg(test)]
mod tests;
