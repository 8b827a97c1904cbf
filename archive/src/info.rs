//! Detailed summary of the contents of a recording.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use crate::damage::{Damage, seconds};
use crate::error::ArchiveError;
use crate::joint_facts::{JointFacts, JointTallies, Twice};
use crate::recording::{Message, Recording, RecordingKind};
use crate::ros::{JointState, JointStateDecoder};
use crate::topic::Topic;
use crate::undecodable::{self, Undecodable, UndecodableTally};

/// Shortest pause that is reported as a gap \[mean periods of the topic\].
/// Chosen: jitter and up to three lost messages stay below, as on any network; a smaller ratio would bury real gaps
/// among ordinary losses.
const GAP_PERIODS: i64 = 5;
/// Maximum number of gaps listed per topic.
/// Layout: by eye; no number depends on it.
const GAPS_LISTED: usize = 5;
/// Maximum number of joints listed per topic.
/// Resolution: bounds memory; more than the joints of a humanoid.
const MOST_NAMES: usize = 64;

/// Summary of the contents of a recording, found by reading all of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Info {
    /// Its path.
    pub path: PathBuf,
    /// Its storage format.
    pub kind: RecordingKind,
    /// Its size on disk \[bytes\].
    pub bytes: u64,
    /// Log time of the first message \[ns since the epoch\].
    pub start_ns: Option<i64>,
    /// Log time of the last message \[ns since the epoch\].
    pub end_ns: Option<i64>,
    /// Time from the first to the last message \[s\].
    pub duration_s: f64,
    /// Number of messages that were read.
    pub message_count: u64,
    /// Its topics.
    pub topics: Vec<TopicInfo>,
    /// Provenance, if the recording was written by tauscope.
    pub provenance: Option<BTreeMap<String, String>>,
    /// Unreadable parts.
    pub damage: Vec<Damage>,
    /// Reason why its joint states cannot be compared with expected efforts, if its format implies one.
    pub obstacle: Option<String>,
}

/// Summary of a topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TopicInfo {
    /// Name, type and number of messages that were read.
    #[serde(flatten)]
    pub topic: Topic,
    /// Mean message rate from the first to the last message of the topic.
    pub rate_hz: Option<f64>,
    /// The longest pauses of at least five mean periods, longest first.
    pub gaps: Vec<Gap>,
    /// Number of messages that cannot be decoded.
    pub undecodable: u64,
    /// Number of messages for each kind of decoding error, with the first reason; at most four kinds.
    pub undecodable_reasons: Vec<Undecodable>,
    /// Summary of its joint states, if it carries any.
    pub joints: Option<JointsInfo>,
}

/// A pause in a topic.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Time of the last message before it, from the start of the recording \[s\].
    pub at_s: f64,
    /// Duration \[s\].
    pub duration_s: f64,
}

/// Summary of the joint states of a topic.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct JointsInfo {
    /// Distinct joint names, in the order of appearance; at most [`MOST_NAMES`].
    pub names: Vec<String>,
    /// Whether positions were given in any message.
    pub position: bool,
    /// Whether velocities were given in any message.
    pub velocity: bool,
    /// Whether efforts were given in any message.
    pub effort: bool,
    /// Number of messages that contain a NaN.
    pub nan_messages: u64,
    /// Number of messages that repeat the values of the preceding message.
    pub repeated_messages: u64,
    /// Number of messages with an earlier stamp than the preceding message.
    pub backward_messages: u64,
    /// Messages that name a joint more than once.
    pub twice: Option<Twice>,
    /// Summary of each joint.
    pub joints: Vec<JointFacts>,
}

impl Info {
    /// Reads all of `recording`, once, with bounded memory.
    ///
    /// # Errors
    /// If it can no longer be opened, or reading fails altogether. Damage is no error.
    pub fn read(recording: &Recording) -> Result<Self, ArchiveError> {
        let mut tallies: Vec<_> = recording.topics().iter().map(Tally::new).collect();
        let mut damage = recording.damage().to_vec();
        let mut messages = recording.all_messages()?;
        while let Some(message) = messages.next_message() {
            match message {
                Ok(message) => tallies[message.topic_index].add(&message),
                Err(ArchiveError::Damaged(found)) => damage.push(found),
                Err(error) => return Err(error),
            }
        }
        let start_ns = tallies.iter().filter_map(|tally| tally.first_ns).min();
        let end_ns = tallies.iter().filter_map(|tally| tally.last_ns).max();
        let topics = tallies.into_iter();
        let topics: Vec<_> = topics
            .map(|tally| tally.finish(start_ns.unwrap_or(0)))
            .collect();
        Ok(Self {
            path: recording.path().to_owned(),
            kind: recording.kind(),
            bytes: recording.bytes(),
            start_ns,
            end_ns,
            duration_s: start_ns
                .zip(end_ns)
                .map_or(0.0, |(start, end)| in_seconds(end - start)),
            message_count: topics.iter().map(|info| info.topic.message_count).sum(),
            topics,
            provenance: recording.provenance().cloned(),
            damage,
            obstacle: recording
                .check_comparable(&[])
                .err()
                .map(|error| error.to_string()),
        })
    }

    /// Whether messages are lost.
    pub fn has_lost_data(&self) -> bool {
        self.damage.iter().any(Damage::loses_data)
    }
}

/// Running counts of a topic.
struct Tally {
    topic: Topic,
    first_ns: Option<i64>,
    last_ns: Option<i64>,
    /// Durations and start times of the longest pauses, longest first.
    pauses_ns: Vec<(i64, i64)>,
    undecodable: UndecodableTally,
    joints: Option<JointsInfo>,
    values: JointTallies,
    decoder: JointStateDecoder,
    state: JointState,
}

impl Tally {
    fn new(topic: &Topic) -> Self {
        let joints = topic.joint_state_type().is_some();
        Self {
            topic: Topic {
                message_count: 0,
                ..topic.clone()
            },
            first_ns: None,
            last_ns: None,
            pauses_ns: Vec::new(),
            undecodable: UndecodableTally::default(),
            joints: joints.then(JointsInfo::default),
            values: JointTallies::default(),
            decoder: JointStateDecoder::default(),
            state: JointState::default(),
        }
    }

    fn add(&mut self, message: &Message<'_>) {
        let log_time_ns = message.log_time_ns;
        self.topic.message_count += 1;
        self.first_ns.get_or_insert(log_time_ns);
        if let Some(last_ns) = self.last_ns.replace(log_time_ns) {
            let pause_ns = log_time_ns - last_ns;
            let rank = self.pauses_ns.partition_point(|&(p, _)| p >= pause_ns);
            if rank < GAPS_LISTED {
                self.pauses_ns.truncate(GAPS_LISTED - 1);
                self.pauses_ns.insert(rank, (pause_ns, last_ns));
            }
        }
        if let Some(joints) = &mut self.joints {
            match message.joint_state_into(&mut self.decoder, &mut self.state) {
                Ok(()) => {
                    joints.add(&self.state);
                    self.values.add(&self.state);
                }
                Err(error) => self.undecodable.add(&error, log_time_ns),
            }
        }
    }

    fn finish(self, start_ns: i64) -> TopicInfo {
        let span_ns = self
            .first_ns
            .zip(self.last_ns)
            .map_or(0, |(first, last)| last - first);
        let periods = i64::try_from(self.topic.message_count.saturating_sub(1)).unwrap_or(0);
        let gap = |&&(pause_ns, _): &&(i64, i64)| {
            pause_ns.saturating_mul(periods) >= span_ns.saturating_mul(GAP_PERIODS)
        };
        let gaps = self.pauses_ns.iter().filter(gap);
        TopicInfo {
            rate_hz: (span_ns > 0).then(|| periods as f64 / in_seconds(span_ns)),
            gaps: gaps
                .map(|&(pause_ns, from_ns)| Gap {
                    at_s: in_seconds(from_ns - start_ns),
                    duration_s: in_seconds(pause_ns),
                })
                .collect(),
            topic: self.topic,
            undecodable: self.undecodable.count(),
            undecodable_reasons: self.undecodable.reasons(),
            joints: self.joints.map(|joints| JointsInfo {
                repeated_messages: self.values.repeated,
                backward_messages: self.values.backward,
                twice: self.values.twice().cloned(),
                joints: self.values.facts(),
                ..joints
            }),
        }
    }
}

impl JointsInfo {
    fn add(&mut self, state: &JointState) {
        for name in &state.name {
            if self.names.len() < MOST_NAMES && !self.names.contains(name) {
                self.names.push(name.clone());
            }
        }
        self.position |= !state.position.is_empty();
        self.velocity |= !state.velocity.is_empty();
        self.effort |= !state.effort.is_empty();
        let mut values = [&state.position, &state.velocity, &state.effort]
            .into_iter()
            .flatten();
        self.nan_messages += u64::from(values.any(|value| value.is_nan()));
    }
}

fn in_seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

fn messages(count: u64) -> String {
    counted(count, "message")
}

fn counted(count: u64, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

/// Shortens a value to a line of a terminal: a simulated archive holds its whole scenario.
fn shortened(value: &str) -> String {
    /// Longest value that is printed whole \[characters\].
    /// Resolution: the length of a line that a person reads.
    const LONGEST: usize = 80;
    let count = value.chars().count();
    if count <= LONGEST && !value.contains('\n') {
        return value.to_owned();
    }
    let line = value.lines().next().unwrap_or_default();
    let start: String = line.chars().take(LONGEST).collect();
    format!("{start}... ({count} characters; --json shows all)")
}

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {}, {} bytes, {} in {:.3} s",
            self.path.display(),
            self.kind,
            self.bytes,
            if self.kind.is_table() {
                counted(self.message_count, "row")
            } else {
                messages(self.message_count)
            },
            self.duration_s
        )?;
        if let Some((start_ns, end_ns)) = self.start_ns.zip(self.end_ns) {
            writeln!(f, "from {} s to {} s", seconds(start_ns), seconds(end_ns))?;
        }
        for topic in &self.topics {
            let Topic {
                name,
                message_count,
                type_name,
                ..
            } = &topic.topic;
            if self.kind.is_table() {
                f.write_str(&counted(*message_count, "row"))?;
            } else {
                write!(f, "{name}: {message_count} x {type_name}")?;
            }
            write!(f, "{topic}")?;
        }
        for (key, value) in self.provenance.iter().flatten() {
            writeln!(f, "made by: {key}: {}", shortened(value))?;
        }
        for damage in &self.damage {
            writeln!(f, "damage: {damage}")?;
        }
        if let Some(obstacle) = &self.obstacle {
            writeln!(f, "warning: {obstacle}")?;
        }
        Ok(())
    }
}

/// Everything about a topic except its name, type and number of messages.
impl fmt::Display for TopicInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.rate_hz {
            Some(rate_hz) => writeln!(f, ", {rate_hz:.1} Hz")?,
            None => writeln!(f)?,
        }
        if let Some(joints) = &self.joints {
            writeln!(f, "  {joints}")?;
            match joints.repeated_messages {
                0 => {}
                1 => writeln!(f, "  1 message repeats the values of the one before")?,
                count => writeln!(f, "  {count} messages repeat the values of the one before")?,
            }
        }
        for gap in &self.gaps {
            writeln!(f, "  a gap of {:.3} s at {:.3} s", gap.duration_s, gap.at_s)?;
        }
        for line in undecodable::lines(self.undecodable, &self.undecodable_reasons) {
            writeln!(f, "  {line}")?;
        }
        if let Some(unreadable) = self.topic.unreadable_joint_states() {
            writeln!(f, "  {unreadable}")?;
        }
        Ok(())
    }
}

impl fmt::Display for JointsInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let position = self.position.then_some("position");
        let velocity = self.velocity.then_some("velocity");
        let effort = self.effort.then_some("effort");
        let given = [position, velocity, effort].into_iter().flatten();
        let given: Vec<_> = given.collect();
        let names = self.names.join(", ");
        match given.as_slice() {
            _ if names.is_empty() => write!(f, "no usable message names a joint")?,
            [] => write!(f, "joints {names} without position, velocity or effort")?,
            given => write!(f, "joints {names} with {}", given.join(", "))?,
        }
        if self.nan_messages > 0 {
            write!(f, "; NaN in {}", messages(self.nan_messages))?;
        }
        Ok(())
    }
}
