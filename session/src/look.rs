//! The first look at a recording: topic, publishers, clock and ranges, from its head.

use tauscope_archive::{ArchiveError, JointFacts, JointTallies, Recording, ros};
use tauscope_bus::MAX_JOINTS;

use crate::assembler::{Assembler, Layouts, Taken};
use crate::clock::{Clock, Stamps};
use crate::error::{SessionError, Unusable};
use crate::finding::{Effect, Finding};
use crate::plausible::odd_velocities;
use crate::publisher::{Publisher, Publishers, choose};
use crate::selection::Selection;
use crate::values::Ranges;

/// Number of messages in the head of a topic.
/// Resolution: bounded memory, 2 MB for seven joints; 100 s of an arm at 100 Hz.
const HEAD: usize = 10_000;

/// Factor by which a velocity differs from the derivative of the position that is not used.
/// Physical: the filter of a drive takes a tenth of the fastest motion at most.
const OFF: f64 = 1.25;

/// Range of a position that shows whether the velocity follows it \[rad or m\].
/// Physical: a hundred steps of a coarse encoder of 6000 steps per turn.
const LEAST_RANGE: f64 = 0.1;

/// Result of reading the head of a recording: topic, publishers, clock and ranges.
#[derive(Debug, Clone)]
pub struct Look {
    /// Topic of the joint states.
    pub topic: String,
    selection: Selection,
}

/// The joints whose states are wanted.
#[derive(Debug, Clone, Copy, Default)]
pub struct Joints<'a> {
    /// Their names, in the robot's order; none for all that are published.
    pub names: &'a [String],
    /// By joint, the effort limit of the robot file \[N m or N\]; empty where there is no robot file.
    pub effort_limits: &'a [Option<f64>],
}

impl Look {
    /// Looks at `topic` of a recording, or at the topic that names most joints where none is given.
    ///
    /// # Errors
    /// If there are no joint states, or their stamps tell no time.
    pub fn at(
        recording: &Recording,
        topic: Option<&str>,
        wanted: Joints<'_>,
    ) -> Result<Self, SessionError> {
        if !wanted.names.is_empty() {
            recording.check_comparable(wanted.names)?;
        }
        let look = match topic {
            Some(topic) => {
                recording.joint_state_topic(topic)?;
                Self::at_topic(recording, topic, wanted)?
            }
            None => Self::at_best(recording, wanted)?,
        };
        let fault = look.selection.of_clock.clone();
        if let Some(fault) = fault.filter(|it| it.effect() == Effect::Fault) {
            return Err(SessionError::Unusable {
                path: recording.path().to_owned(),
                why: Unusable::Finding {
                    topic: look.selection.topic,
                    finding: Box::new(fault),
                },
            });
        }
        Ok(look)
    }

    /// The topic that gives positions and efforts of most of the joints.
    fn at_best(recording: &Recording, wanted: Joints<'_>) -> Result<Self, SessionError> {
        let mut ranked: Vec<((bool, bool, usize), Self)> = Vec::new();
        let mut error = None;
        for topic in recording.topics() {
            if topic.joint_state_type().is_none() || topic.message_count == 0 {
                continue;
            }
            let look = match Self::at_topic(recording, &topic.name, wanted) {
                Ok(look) => look,
                Err(found) => {
                    error.get_or_insert(found);
                    continue;
                }
            };
            let used = || look.selection.used_publishers();
            let known = look
                .selection
                .joint_names
                .iter()
                .filter(|joint| look.names(joint));
            let rank = (
                used().any(|it| it.position),
                used().any(Publisher::measures_effort),
                known.count(),
            );
            ranked.push((rank, look));
        }
        let most = ranked.iter().map(|(rank, _)| *rank).max();
        ranked.retain(|(rank, _)| Some(*rank) == most);
        if ranked.len() > 1 && !wanted.names.is_empty() {
            // The name that ROS 2 drivers use by default.
            let is_usual = |(_, look): &(_, Self)| look.topic == "/joint_states";
            if !ranked.iter().any(is_usual) {
                let topics = ranked.iter().map(|(_, look)| look.topic.clone());
                return Err(SessionError::SeveralTopics {
                    path: recording.path().to_owned(),
                    topics: topics.collect(),
                });
            }
            ranked.retain(is_usual);
        }
        if let Some((_, look)) = ranked.into_iter().next() {
            return Ok(look);
        }
        if let Some(found) = recording.unreadable_joint_states().into_iter().next() {
            return Err(SessionError::Archive(ArchiveError::UnreadableJointStates {
                path: recording.path().to_owned(),
                found: Box::new(found),
            }));
        }
        let known = recording.topics().iter();
        Err(error.unwrap_or_else(|| SessionError::NoJointStates {
            path: recording.path().to_owned(),
            known: known
                .map(|topic| format!("{} ({})", topic.name, topic.type_name))
                .collect(),
        }))
    }

    fn at_topic(
        recording: &Recording,
        topic: &str,
        wanted: Joints<'_>,
    ) -> Result<Self, SessionError> {
        let mut joint_names = wanted.names.to_vec();
        let head = Head::read(recording, topic)?;
        let mut publishers = Publishers::of_recording();
        head.each(|message, log_time_ns| {
            publishers.add(message, log_time_ns);
        });
        if joint_names.is_empty() {
            joint_names = published(&publishers.all);
        }
        if joint_names.len() > MAX_JOINTS {
            return Err(SessionError::TooManyJoints {
                path: recording.path().to_owned(),
                found: joint_names.len(),
            });
        }
        let used = choose(&publishers.all, &joint_names);
        let limits =
            (0..joint_names.len()).map(|joint| wanted.effort_limits.get(joint).copied().flatten());
        let mut look = Self {
            topic: topic.to_owned(),
            selection: Selection {
                topic: (!recording.kind().is_table()).then(|| topic.to_owned()),
                ranges: Ranges::new(limits),
                joint_names,
                clock: Clock::Stamps,
                publishers,
                used,
                of_clock: None,
                of_velocity: None,
            },
        };
        look.judge_clock(&head);
        look.judge_velocity(&head);
        Ok(look)
    }

    /// Chooses the clock, and takes the ranges of the values.
    fn judge_clock(&mut self, head: &Head) {
        let selection = &mut self.selection;
        let mut stamps = Stamps::default();
        let mut last = ros::JointState::default();
        let mut layouts = Layouts::new(&selection.joint_names);
        // Publishers of parts of one state share stamps rightly, so the clock is judged by one of them.
        let used = (0..selection.used.len()).filter(|&place| selection.used[place]);
        let main = used.max_by_key(|&place| selection.publishers.all[place].messages);
        head.each(|message, log_time_ns| {
            let place = selection.publishers.place(message);
            if !place.is_some_and(|place| selection.used[place]) {
                return;
            }
            let fields = [&message.position, &message.velocity, &message.effort];
            if place == main {
                let is_new = message.position != last.position || message.effort != last.effort;
                stamps.add(message.header.stamp.ns(), log_time_ns, is_new);
                last.position.clone_from(&message.position);
                last.effort.clone_from(&message.effort);
            }
            let places = &layouts.of(&message.name).places;
            for (field, values) in fields.into_iter().enumerate() {
                for (joint, value) in places.iter().zip(values) {
                    if let Some(joint) = joint.filter(|_| value.is_finite()) {
                        selection.ranges.take(joint, field, *value);
                    }
                }
            }
        });
        (selection.clock, selection.of_clock) = stamps.clock(head.has_log_times);
    }

    /// Compares velocities with positions, on the clock that was chosen, if there are velocities.
    fn judge_velocity(&mut self, head: &Head) {
        let used = || self.selection.used_publishers();
        if used().any(|it| it.position) && !used().any(|it| it.velocity) {
            self.selection.of_velocity = Some(Finding::NoVelocity);
            return;
        }
        let mut assembler = self.assembler().keeping_velocity();
        let mut tallies = JointTallies::in_order(self.joint_names());
        let count = self.joint_names().len();
        head.each(|message, log_time_ns| {
            if let Taken::Follows(whole) = assembler.take(message, log_time_ns)
                && whole.has_velocity
            {
                let (position, velocity) = (&whole.position[..count], &whole.velocity[..count]);
                tallies.add_values(whole.stamp_ns, position, velocity, &[]);
            }
        });
        let facts = tallies.facts();
        // Positions in degrees are another finding; the vibration of a joint at rest tells no velocity.
        let moves = |facts: &JointFacts| {
            let range = facts.position_range;
            range.is_some_and(|[low, high]| high - low > LEAST_RANGE)
        };
        let is_off = |facts: &JointFacts| {
            let slope = facts.velocity_slope.filter(|_| !facts.is_in_degrees());
            slope.is_some_and(|slope| !(1.0 / OFF..=OFF).contains(&slope))
        };
        if facts.iter().any(|facts| moves(facts) && is_off(facts)) {
            self.selection.of_velocity = odd_velocities(&facts, true);
        }
    }

    /// Time of the first message that is used, and its log time \[ns\]; `None` if there is none.
    ///
    /// # Errors
    /// If the recording can no longer be read.
    pub fn start_ns(&self, recording: &Recording) -> Result<Option<(i64, i64)>, SessionError> {
        let mut states = recording.joint_states(&self.topic)?;
        while let Some(state) = states.next_state() {
            let Ok(state) = state else { continue };
            let place = self.selection.publishers.place(state.message);
            if place.is_none_or(|place| self.selection.used[place]) {
                let stamp_ns = state.message.header.stamp.ns();
                let time_ns = self.selection.clock.time_ns(stamp_ns, state.log_time_ns);
                return Ok(Some((time_ns, state.log_time_ns)));
            }
        }
        Ok(None)
    }

    /// The topic, unless the recording is a table.
    pub fn topic_of_messages(&self) -> Option<&str> {
        self.selection.topic.as_deref()
    }

    /// The robot's joints; those that the publishers name where no robot was given.
    pub fn joint_names(&self) -> &[String] {
        &self.selection.joint_names
    }

    /// An assembler of the recording.
    pub fn assembler(&self) -> Assembler {
        Assembler::new(self.selection.rewound())
    }

    /// Whether a publisher that is used names the joint.
    pub fn names(&self, joint: &str) -> bool {
        self.selection
            .used_publishers()
            .any(|publisher| publisher.names.iter().any(|name| name == joint))
    }

    /// All joints that the publishers in use name, in the order of their messages.
    pub fn recorded(&self) -> Vec<String> {
        let used: Vec<Publisher> = self.selection.used_publishers().cloned().collect();
        published(&used)
    }
}

/// The joints that publishers name, each once, in the order of their messages. At most 16, as many as a sample holds.
fn published(all: &[Publisher]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let with_effort = all.iter().filter(|it| it.position && it.measures_effort());
    let with_position = all.iter().filter(|it| it.position);
    for publisher in with_effort.chain(with_position).chain(all) {
        for name in &publisher.names {
            if !names.contains(name) && names.len() < tauscope_bus::MAX_JOINTS {
                names.push(name.clone());
            }
        }
    }
    names
}

/// The first messages of a topic: the names of their joints once, and their numbers in one array.
#[derive(Default)]
struct Head {
    messages: Vec<Brief>,
    numbers: Vec<f64>,
    /// Messages without numbers, one for each frame and list of names.
    forms: Vec<ros::JointState>,
    /// Whether the format has a time of recording besides the stamps.
    has_log_times: bool,
}

/// A message of a [`Head`].
struct Brief {
    log_time_ns: i64,
    stamp: ros::Time,
    /// Its form.
    form: usize,
    /// Number of positions, velocities and efforts.
    lengths: [usize; 3],
}

impl Head {
    fn read(recording: &Recording, topic: &str) -> Result<Self, SessionError> {
        let mut states = recording.joint_states(topic)?;
        let mut head = Self {
            has_log_times: !recording.kind().is_table(),
            ..Self::default()
        };
        for _ in 0..HEAD {
            let Some(state) = states.next_state() else {
                break;
            };
            // The reading that follows counts messages that cannot be decoded.
            if let Ok(state) = state {
                head.add(state.message, state.log_time_ns);
            }
        }
        Ok(head)
    }

    fn add(&mut self, message: &ros::JointState, log_time_ns: i64) {
        let is_form = |form: &ros::JointState| {
            form.name == message.name && form.header.frame_id == message.header.frame_id
        };
        let known = self.forms.iter().position(is_form);
        let form = known.unwrap_or_else(|| {
            self.forms.push(ros::JointState {
                header: message.header.clone(),
                name: message.name.clone(),
                ..ros::JointState::default()
            });
            self.forms.len() - 1
        });
        let fields = [&message.position, &message.velocity, &message.effort];
        for field in fields {
            self.numbers.extend_from_slice(field);
        }
        self.messages.push(Brief {
            log_time_ns,
            stamp: message.header.stamp,
            form,
            lengths: fields.map(Vec::len),
        });
    }

    /// Calls `visit` with each message and its log time \[ns\], in the order of the recording.
    fn each(&self, mut visit: impl FnMut(&ros::JointState, i64)) {
        let mut forms = self.forms.clone();
        let mut numbers = &*self.numbers;
        for brief in &self.messages {
            let message = &mut forms[brief.form];
            message.header.stamp = brief.stamp;
            let fields = [
                &mut message.position,
                &mut message.velocity,
                &mut message.effort,
            ];
            for (field, length) in fields.into_iter().zip(brief.lengths) {
                let (own, rest) = numbers.split_at(length);
                numbers = rest;
                field.clear();
                field.extend_from_slice(own);
            }
            visit(message, brief.log_time_ns);
        }
    }
}
