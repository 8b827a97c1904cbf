//! Packing of messages from several topics into one sample per instant. Pure: no clock, no I/O.
//!
//! An [`Assembler`] combines the messages into states of all joints. A missing velocity is differentiated. Each
//! sample receives the newest command, the newest effort of another twin and the tool, at or before its stamp. A
//! sample waits briefly for these, so that the result does not depend on the order of arrival.

mod differentiate;
mod refused;
mod settings;
mod side;

use std::collections::VecDeque;

use tauscope_archive::ros;
use tauscope_bus::{Header, JointArray, JointState, MAX_JOINTS, flags};
use tauscope_dynamics::Unwrap;
use tauscope_session::{Assembler, Counts, Finding, Gather, Layouts, Taken, Whole, stamp_of};

use crate::config::ConfigError;
use crate::setup::{Setup, Tool};
use differentiate::Differentiator;
pub(crate) use differentiate::MAX_GAP_NS;
use refused::Reported;
pub use settings::PackSettings;
use side::Side;

/// Maximum number of samples that wait for their command.
/// Resolution: memory; about 1 s at 1 kHz.
const MAX_PENDING: usize = 1024;

/// Packs messages into samples.
#[derive(Debug)]
pub struct Packer {
    settings: PackSettings,
    joint_count: usize,
    assembler: Assembler,
    /// Joint layouts of the messages on the side topics.
    layouts: Layouts,
    command: Gather,
    reference: Gather,
    /// Unwrapping of the full turns that the driver removed, of measured and of commanded positions.
    turns: [[Unwrap; MAX_JOINTS]; 2],
    state_velocity: Differentiator,
    command_velocity: Differentiator,
    commands: Side<Command>,
    references: Side<JointArray>,
    tools: Side<Option<Tool>>,
    fixed_tool: Option<Tool>,
    /// Whether learning was requested since the newest sample.
    learning_asked: bool,
    /// Commands of a recording that wait for a sample.
    told: VecDeque<tauscope_bus::Command>,
    pending: VecDeque<JointState>,
    flushed: bool,
    packed: u64,
    /// Counts of the side topics.
    side_counts: Counts,
    reported: Reported,
}

#[derive(Debug, Clone, Copy)]
enum Topic {
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
    /// Creates a packer for a cell whose source is live.
    ///
    /// # Errors
    /// If there are more joints than a sample holds.
    pub fn new(setup: &Setup, settings: PackSettings) -> Result<Self, ConfigError> {
        Self::with(setup, settings, Assembler::live)
    }

    /// Creates a packer whose assembler is made from the joints' names by `assembler`.
    ///
    /// # Errors
    /// If there are more joints than a sample holds.
    pub fn with(
        setup: &Setup,
        settings: PackSettings,
        assembler: impl FnOnce(&[String]) -> Assembler,
    ) -> Result<Self, ConfigError> {
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
            assembler: assembler(&setup.joint_names),
            layouts: Layouts::new(&setup.joint_names),
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
            flushed: false,
            packed: 0,
            side_counts: Counts::default(),
            reported: Reported::default(),
        })
    }

    /// Returns the counts of packed and refused messages.
    pub fn counts(&self) -> Counts {
        let (states, sides) = (self.assembler.counts(), self.side_counts);
        Counts {
            packed: self.packed,
            not_finite: states.not_finite + sides.not_finite,
            incomplete: states.incomplete + sides.incomplete,
            ambiguous: states.ambiguous + sides.ambiguous,
            foreign: states.foreign + sides.foreign,
            ..states
        }
    }

    /// Returns the joints of the cell that a message names: bit j is joint j.
    pub(crate) fn joints_of(&mut self, message: &ros::JointState) -> u32 {
        self.assembler.joints_of(message)
    }

    /// Counts a state that cannot be decoded, with the reason.
    pub fn undecodable(&mut self, reason: &str) {
        self.assembler.undecodable(reason);
    }

    /// Returns the findings about the messages so far.
    pub fn findings(&self) -> Vec<Finding> {
        let sides = [
            (&self.command, "of the commands"),
            (&self.reference, "of the other twin"),
        ];
        let sides = sides.into_iter().flat_map(|(gather, of)| {
            let all = gather.not_finite();
            all.map(move |(joint, values)| Finding::NotFinite {
                joint: format!("{} ({of})", self.layouts.joint_name(joint)),
                values,
            })
        });
        self.assembler.findings().into_iter().chain(sides).collect()
    }

    /// Takes a measured state that was received at `received_ns`.
    pub fn state(&mut self, message: &ros::JointState, received_ns: i64) {
        match self.assembler.take(message, received_ns) {
            Taken::Follows(whole) => self.sample(&whole, 0, received_ns),
            Taken::SetBack(whole) => {
                self.turns = Default::default();
                self.state_velocity.reset();
                self.sample(&whole, flags::RESET, received_ns);
            }
            Taken::Nothing => {}
        }
    }

    /// Takes a command.
    pub fn command(&mut self, message: &ros::JointState, received_ns: i64) {
        let Some(whole) = self.gather(Topic::Command, message, received_ns) else {
            return;
        };
        if !whole.has_position {
            self.side_counts.incomplete += 1;
            return;
        }
        let position = self.unwrapped(true, &whole);
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
            self.side_counts.incomplete += 1;
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
            self.side_counts.not_finite += 1;
            return;
        }
        let stamp_ns = stamp_of(&message.header, received_ns);
        self.tools
            .push(stamp_ns, (tool.mass_kg > 0.0).then_some(tool));
    }

    /// Takes a request that the detectors relearn. It has no stamp of its own, so the next state carries it.
    pub fn learn(&mut self, message: ros::Bool) {
        self.learning_asked |= message.data;
    }

    /// Takes a command of a recording. The next state carries it.
    pub fn told(&mut self, command: tauscope_bus::Command) {
        if self.told.len() < MAX_PENDING {
            self.told.push_back(command);
        }
    }

    /// Returns the next sample that is due. `now_ns` is the current time on the clock of reception (for a
    /// recording, the time of the newest message).
    pub fn pop(&mut self, now_ns: i64) -> Option<JointState> {
        self.is_due(now_ns).then(|| {
            let mut sample = JointState::default();
            self.pop_into(&mut sample);
            sample
        })
    }

    /// Whether [`Packer::pop`] returns a sample.
    pub fn is_due(&self, now_ns: i64) -> bool {
        self.pending.front().is_some_and(|front| {
            let stamp_ns = front.header.stamp_ns;
            let complete = (!self.settings.expects_command || self.commands.reaches(stamp_ns))
                && (!self.settings.expects_reference || self.references.reaches(stamp_ns));
            // Absolute: a clock of reception that is set back must not block the sample for ever.
            let waited_ns = now_ns.saturating_sub(front.header.received_ns);
            let waited = waited_ns.saturating_abs() >= self.settings.wait_ns;
            complete || waited || self.flushed || self.pending.len() >= MAX_PENDING
        })
    }

    /// Writes the sample that is due into `sample`.
    pub fn pop_into(&mut self, sample: &mut JointState) {
        if let Some(front) = self.pending.front() {
            *sample = *front;
            self.pending.pop_front();
            self.attach(sample);
            self.packed += 1;
        }
    }

    /// Whether a sample waits.
    pub fn is_waiting(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Ends the input: no sample waits any longer.
    pub fn flush(&mut self) {
        self.flushed = true;
    }

    /// Adds a message of a side topic to its partial state; returns the state once it has all joints.
    fn gather(
        &mut self,
        topic: Topic,
        message: &ros::JointState,
        received_ns: i64,
    ) -> Option<Whole> {
        let layout = self.layouts.of(&message.name);
        if layout.joints == 0 {
            self.side_counts.foreign += 1;
            return None;
        }
        if layout.twice.is_some() {
            self.side_counts.ambiguous += 1;
            return None;
        }
        let gather = match topic {
            Topic::Command => &mut self.command,
            Topic::Reference => &mut self.reference,
        };
        let times_ns = (stamp_of(&message.header, received_ns), received_ns);
        let whole = gather.add(layout, message, times_ns, false)?;
        if !whole.is_finite(self.joint_count) {
            self.side_counts.not_finite += 1;
            return None;
        }
        Some(whole)
    }

    /// Returns the positions without the driver's wrapping.
    fn unwrapped(&mut self, is_command: bool, whole: &Whole) -> JointArray {
        let mut position = whole.position;
        let turns = &mut self.turns[usize::from(is_command)];
        for (position, turns) in position.iter_mut().zip(turns).take(self.joint_count) {
            *position = turns.next(whole.stamp_ns, *position);
        }
        position
    }

    /// Appends a state of all joints to the samples that wait.
    fn sample(&mut self, whole: &Whole, flags: u32, received_ns: i64) {
        let mut flags = flags
            + flags::EFFORT_MEASURED * u32::from(whole.has_effort)
            + flags::VELOCITY_MEASURED * u32::from(whole.has_velocity);
        let position = self.unwrapped(false, whole);
        let differentiated = self.state_velocity.update(
            whole.stamp_ns,
            &position,
            whole.has_velocity.then_some(&whole.velocity),
        );
        if differentiated.restarted && self.packed + self.pending.len() as u64 > 0 {
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

    /// Attaches the command, the other twin's effort and the tool of the sample's instant.
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
        // A tool does not age: it stays attached until another one is reported.
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
