//! A recording as columns: what was measured, sample by sample, in the robot's joint order.

mod even_clock;
mod losses;
mod rate;
mod reference;

use std::path::{Path, PathBuf};

use tauscope_archive::{ArchiveError, Recording as Archive, name_of};
use tauscope_dynamics::Unwrap;

pub use even_clock::EvenClock;
pub use losses::Losses;
pub use rate::{MAX_GAP_S, mean_step_s};

/// Efforts that are plain zeros at all of so many joints are no measurement. Fewer may be zero by chance, in coarse steps.
/// Physical: of three joints one bears weight.
const LEAST_JOINTS: usize = 3;
/// Fewer rows of plain zeros are no other publisher, and harm no fit.
/// Resolution: a tenth of a second at 100 Hz.
const LEAST_ROWS: usize = 10;

/// One recording. Matrices are row-major: `joint_count` numbers per sample.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The file's stem.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
    /// Stamp of its first sample \[ns since the epoch\].
    pub start_ns: i64,
    /// Time of each sample since the first \[s\], strictly increasing; on the drive's clock where that is known.
    pub time_s: Vec<f64>,
    /// Position \[rad or m\].
    pub position: Vec<f64>,
    /// Velocity as recorded \[rad/s or m/s\]; empty where there is none.
    pub velocity: Vec<f64>,
    /// Effort in the recording's unit; empty where there is none.
    pub effort: Vec<f64>,
    /// Another twin's effort at the same instants, in the recording's unit; empty where there is none.
    pub reference: Vec<f64>,
    /// For each recorded row, the sample that stands for it: repeated rows share one.
    pub sample_of_row: Vec<usize>,
    /// The drive's clock, where the stamps were put back on it.
    pub clock: Option<EvenClock>,
    /// What was dropped on reading.
    pub losses: Losses,
}

/// Why a recording cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// It cannot be read.
    #[error(transparent)]
    Archive(#[from] ArchiveError),
    /// A joint of the robot is not in it.
    #[error("{path}: joint `{joint}` is not in it; it has: {known}", path = path.display())]
    MissingJoint {
        /// The recording.
        path: PathBuf,
        /// The robot's joint.
        joint: String,
        /// The recording's joints.
        known: String,
    },
    /// A joint's effort or position is never a number.
    #[error("{path}: {what} of joint `{joint}` is NaN throughout", path = path.display())]
    AlwaysNan {
        /// The recording.
        path: PathBuf,
        /// `position` or `effort`.
        what: &'static str,
        /// The joint.
        joint: String,
    },
    /// Nothing usable is left.
    #[error("{path}: no usable joint states on `{topic}`", path = path.display())]
    Empty {
        /// The recording.
        path: PathBuf,
        /// The topic.
        topic: String,
    },
}

/// Topics to read.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingTopics {
    /// Measured joint states.
    pub state: String,
    /// Another twin's efforts.
    pub reference: Option<String>,
    /// How much of a recording is read, from its first sample on \[s\]; infinite for all of it.
    pub longest_s: f64,
}

impl Recording {
    /// Reads a recording, joints put in the order of `joint_names`.
    ///
    /// # Errors
    /// If it cannot be read, lacks a joint or holds nothing usable.
    pub fn read(
        path: &Path,
        topics: &RecordingTopics,
        joint_names: &[String],
    ) -> Result<Self, RecordingError> {
        let archive = Archive::open_comparable(path, joint_names)?;
        let name = name_of(path);
        let mut reader = Reader {
            recording: Self {
                name,
                path: path.to_owned(),
                start_ns: 0,
                time_s: Vec::new(),
                position: Vec::new(),
                velocity: Vec::new(),
                effort: Vec::new(),
                reference: Vec::new(),
                sample_of_row: Vec::new(),
                clock: None,
                losses: Losses::default(),
            },
            joint_names,
            order: Vec::new(),
            names: Vec::new(),
            known: String::new(),
            finite_position: vec![false; joint_names.len()],
            finite_effort: vec![false; joint_names.len()],
            last_ns: None,
            turns: vec![Unwrap::default(); joint_names.len()],
            has_velocity: true,
            has_effort: false,
            measured: Vec::new(),
        };
        // What is known on opening, and what is found on the way.
        let mut damage = archive.damage().to_vec();
        let mut states = archive.joint_states(&topics.state)?;
        while reader.recording.duration_s() < topics.longest_s
            && let Some(state) = states.next_state()
        {
            match state {
                Ok(stamped) => reader.take(stamped.message),
                Err(ArchiveError::Damaged(part)) => {
                    if !damage.contains(&part) {
                        damage.push(part);
                    }
                }
                Err(_) => reader.recording.losses.unreadable += 1,
            }
        }
        let lost = damage.iter().filter(|part| part.loses_data());
        reader.recording.losses.damaged = lost.count() as u64;
        let mut recording = reader.finish(&topics.state)?;
        match &topics.reference {
            Some(topic) => recording.read_reference(&archive, topic, joint_names)?,
            None => recording.put_on_even_clock(),
        }
        Ok(recording)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// From the first sample to the last \[s\].
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }
}

/// Where each of `wanted` stands in `names`; the first that is not there otherwise.
fn indices(names: &[String], wanted: &[String]) -> Result<Vec<usize>, String> {
    let find = |joint: &String| {
        let at = names.iter().position(|name| name == joint);
        at.ok_or_else(|| joint.clone())
    };
    wanted.iter().map(find).collect()
}

struct Reader<'a> {
    recording: Recording,
    joint_names: &'a [String],
    /// Where each of the robot's joints stands in the message.
    order: Vec<usize>,
    /// Names of the message that `order` holds for.
    names: Vec<String>,
    known: String,
    finite_position: Vec<bool>,
    finite_effort: Vec<bool>,
    last_ns: Option<i64>,
    /// By joint, whole turns that the driver has taken off.
    turns: Vec<Unwrap>,
    has_velocity: bool,
    has_effort: bool,
    /// By sample, whether some effort is not zero.
    measured: Vec<bool>,
}

impl Reader<'_> {
    fn take(&mut self, message: &tauscope_archive::ros::JointState) {
        let recording = &mut self.recording;
        if self.order.is_empty() || message.name != self.names {
            self.known = message.name.join(", ");
            let Ok(order) = indices(&message.name, self.joint_names) else {
                // What names none of the joints tells of another device, such as a gripper.
                let is_own = |name| self.joint_names.contains(name);
                recording.losses.incomplete += u64::from(message.name.iter().any(is_own));
                self.skip_row();
                return;
            };
            self.order = order;
            self.names.clone_from(&message.name);
        }
        let stamp_ns = message.header.stamp.ns();
        let count = message.name.len();
        if message.position.len() != count {
            recording.losses.incomplete += 1;
            self.skip_row();
            return;
        }
        if let Some(last_ns) = self.last_ns {
            if stamp_ns < last_ns {
                recording.losses.backward += 1;
                self.skip_row();
                return;
            }
            if stamp_ns == last_ns {
                recording.losses.repeated += 1;
                self.skip_row();
                return;
            }
        }
        let effort = (message.effort.len() == count).then_some(&message.effort);
        self.has_effort |= effort.is_some();
        let velocity = (message.velocity.len() == count).then_some(&message.velocity);
        let mut finite = true;
        for (j, &at) in self.order.iter().enumerate() {
            let position = message.position[at].is_finite();
            self.finite_position[j] |= position;
            finite &= position;
            if let Some(effort) = effort {
                self.finite_effort[j] |= effort[at].is_finite();
                finite &= effort[at].is_finite();
            }
        }
        if !finite {
            recording.losses.not_finite += 1;
            self.skip_row();
            return;
        }
        if recording.time_s.is_empty() {
            recording.start_ns = stamp_ns;
        }
        self.last_ns = Some(stamp_ns);
        recording
            .time_s
            .push((stamp_ns - recording.start_ns) as f64 * 1e-9);
        recording.sample_of_row.push(recording.time_s.len() - 1);
        for (turns, &at) in self.turns.iter_mut().zip(&self.order) {
            recording
                .position
                .push(turns.next(stamp_ns, message.position[at]));
        }
        match velocity {
            Some(velocity) if self.has_velocity => {
                let own = self.order.iter().map(|&at| velocity[at]);
                recording.velocity.extend(own);
            }
            _ => self.has_velocity = false,
        }
        let first = recording.effort.len();
        let of = |at: &usize| effort.map_or(0.0, |effort| effort[*at]);
        recording.effort.extend(self.order.iter().map(of));
        let is_measured = recording.effort[first..]
            .iter()
            .any(|effort| *effort != 0.0);
        self.measured.push(is_measured);
    }

    /// A row that is left out is answered by the sample before it.
    fn skip_row(&mut self) {
        let last = self.recording.time_s.len().saturating_sub(1);
        self.recording.sample_of_row.push(last);
    }

    fn finish(mut self, topic: &str) -> Result<Recording, RecordingError> {
        let path = || self.recording.path.clone();
        if self.order.is_empty() && !self.known.is_empty() {
            let joint = self
                .joint_names
                .iter()
                .find(|joint| !self.known.split(", ").any(|name| name == joint.as_str()));
            return Err(RecordingError::MissingJoint {
                path: path(),
                joint: joint.cloned().unwrap_or_default(),
                known: self.known.clone(),
            });
        }
        if self.recording.losses.not_finite > 0 {
            let nan = |what, seen: &[bool]| {
                let joint = seen.iter().position(|seen| !seen)?;
                Some(RecordingError::AlwaysNan {
                    path: path(),
                    what,
                    joint: self.joint_names[joint].clone(),
                })
            };
            if let Some(error) = nan("the position", &self.finite_position) {
                return Err(error);
            }
            if let Some(error) = nan("the effort", &self.finite_effort)
                && self.has_effort
            {
                return Err(error);
            }
        }
        if self.recording.time_s.len() < 2 {
            return Err(RecordingError::Empty {
                path: path(),
                topic: topic.to_owned(),
            });
        }
        if !self.has_velocity {
            self.recording.velocity.clear();
        }
        if !self.has_effort {
            self.recording.effort.clear();
        } else if self.joint_names.len() >= LEAST_JOINTS
            && self.measured.contains(&true)
            && self.measured.iter().filter(|is| !**is).count() >= LEAST_ROWS
        {
            self.recording.keep_measured(&self.measured);
        }
        Ok(self.recording)
    }
}
