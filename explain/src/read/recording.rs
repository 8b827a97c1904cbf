//! A recording as columns: the measured values, sample by sample, in the robot's joint order.

mod even_clock;
mod losses;
mod rate;
mod reference;

use std::path::{Path, PathBuf};

use tauscope_archive::{ArchiveError, name_of};
use tauscope_dynamics::Unwrap;
use tauscope_session::{Assembler, Finding, Joints, Look, Plausible, SessionError, Taken, Whole};

pub use even_clock::EvenClock;
pub use losses::Losses;
pub use rate::{MAX_GAP_S, mean_step_s};
pub use reference::Series;

/// Smallest number of joints for which exact zeros at all of them are not a measurement. Fewer joints may be at zero
/// by chance, with coarse quantisation.
/// Physical: of three joints one bears weight.
const LEAST_JOINTS: usize = 3;
/// Smallest number of rows of exact zeros that is attributed to another publisher. Fewer do not affect a fit.
/// Resolution: a tenth of a second at 100 Hz.
const LEAST_ROWS: usize = 10;

/// One recording. Matrices are row-major: `joint_count` numbers per sample.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The file's stem.
    pub name: String,
    /// Path of the file or folder.
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
    /// Effort of the external twin at the same instants, in the recording's unit; empty where there is none.
    pub reference: Vec<f64>,
    /// Sample that represents each recorded row: repeated rows share one, and lost rows have none.
    pub sample_of_row: Vec<Option<usize>>,
    /// The drive's clock, if the samples were placed on it.
    pub clock: Option<EvenClock>,
    /// Messages and rows that were dropped on reading.
    pub losses: Losses,
    /// Findings on reading.
    pub findings: Vec<Finding>,
}

/// Topics to read.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingTopics {
    /// Measured joint states.
    pub state: String,
    /// Efforts of the external twin.
    pub reference: Option<String>,
    /// Length from the first sample that is read \[s\]; infinite for the whole recording.
    pub longest_s: f64,
}

impl Recording {
    /// Reads a recording with its joints in the order of `joints`.
    ///
    /// # Errors
    /// If it cannot be read, lacks a joint or holds nothing usable.
    pub fn read(
        path: &Path,
        topics: &RecordingTopics,
        joints: Joints<'_>,
    ) -> Result<Self, SessionError> {
        let archive = tauscope_session::open(path)?;
        let look = Look::at(&archive, Some(&topics.state), joints)?;
        let mut reader = Reader::new(path, &look);
        // Damage known on opening, and damage found while reading.
        let mut damage = archive.damage().to_vec();
        let mut states = archive.joint_states(&topics.state)?;
        while reader.recording.duration_s() < topics.longest_s
            && let Some(state) = states.next_state()
        {
            match state {
                Ok(state) => reader.take(state.message, state.log_time_ns),
                Err(ArchiveError::Damaged(part)) => {
                    if !damage.contains(&part) {
                        damage.push(part);
                    }
                }
                Err(error) => {
                    reader.assembler.undecodable(&error.reason());
                    reader.recording.losses.unreadable += 1;
                }
            }
        }
        let lost = damage.iter().filter(|part| part.loses_data());
        reader.recording.losses.damaged = lost.count() as u64;
        let mut recording = reader.finish(archive.remarks())?;
        match &topics.reference {
            Some(topic) => recording.read_reference(&archive, topic, joints.names)?,
            None => recording.put_on_even_clock(),
        }
        Ok(recording)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether the time of recording replaces the stamps.
    pub fn is_timed_by_log(&self) -> bool {
        let is_replaced = |finding: &Finding| match finding {
            Finding::ConstantStamps { is_replaced, .. }
            | Finding::CoarseStamps { is_replaced, .. } => *is_replaced,
            _ => false,
        };
        self.findings.iter().any(is_replaced)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// Returns the time from the first sample to the last \[s\].
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }
}

struct Reader {
    recording: Recording,
    assembler: Assembler,
    plausible: Plausible,
    joint_count: usize,
    /// Whole turns that the driver has removed, by joint.
    turns: Vec<Unwrap>,
    has_velocity: bool,
    /// Whether the efforts are a measurement, by sample.
    measured: Vec<bool>,
    has_effort: bool,
}

impl Reader {
    fn new(path: &Path, look: &Look) -> Self {
        let joint_count = look.joint_names().len();
        Self {
            recording: Recording {
                name: name_of(path),
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
                findings: Vec::new(),
            },
            // A fit needs increasing times, and the audit determines the scale of a velocity.
            assembler: look.assembler().refusing_set_back().keeping_velocity(),
            plausible: Plausible::new(look.joint_names(), None),
            joint_count,
            turns: vec![Unwrap::default(); joint_count],
            has_velocity: true,
            measured: Vec::new(),
            has_effort: false,
        }
    }

    fn take(&mut self, message: &tauscope_archive::ros::JointState, received_ns: i64) {
        let lost = self.assembler.counts().dropped();
        match self.assembler.take(message, received_ns) {
            Taken::Follows(whole) | Taken::SetBack(whole) => self.push(&whole),
            Taken::Nothing => {}
        }
        let is_lost = self.assembler.counts().dropped() > lost;
        let newest = self.recording.time_s.len().saturating_sub(1);
        (self.recording.sample_of_row).push((!is_lost).then_some(newest));
    }

    fn push(&mut self, whole: &Whole) {
        let recording = &mut self.recording;
        if recording.time_s.is_empty() {
            recording.start_ns = whole.stamp_ns;
        }
        let since_ns = whole.stamp_ns - recording.start_ns;
        recording.time_s.push(since_ns as f64 * 1e-9);
        let n = self.joint_count;
        for (turns, position) in self.turns.iter_mut().zip(&whole.position[..n]) {
            let position = turns.next(whole.stamp_ns, *position);
            recording.position.push(position);
        }
        self.has_velocity &= whole.has_velocity;
        if self.has_velocity {
            recording.velocity.extend_from_slice(&whole.velocity[..n]);
        }
        let efforts = &whole.effort[..n];
        recording.effort.extend_from_slice(efforts);
        self.has_effort |= whole.has_effort;
        let are_zeros = n >= LEAST_JOINTS && efforts.iter().all(|effort| *effort == 0.0);
        self.measured.push(whole.has_effort && !are_zeros);
        self.plausible.add_whole(whole, n);
    }

    fn finish(mut self, remarks: &[String]) -> Result<Recording, SessionError> {
        let counts = self.assembler.counts();
        let losses = &mut self.recording.losses;
        losses.refused = counts.dropped();
        losses.repeated = counts.repeated;
        if self.recording.time_s.len() < 2 {
            return Err(SessionError::Unusable {
                path: self.recording.path,
                why: self.assembler.unusable(),
            });
        }
        let remarks = remarks.iter().cloned();
        let mut findings: Vec<Finding> = remarks.map(|remark| Finding::Format { remark }).collect();
        findings.extend(self.assembler.findings());
        // The first look has already checked the velocities.
        let of_values = self.plausible.findings().into_iter();
        findings.extend(of_values.filter(|it| !matches!(it, Finding::Velocity { .. })));
        self.recording.findings = findings;
        if !self.has_velocity {
            self.recording.velocity.clear();
        }
        let unmeasured = self.measured.iter().filter(|is| !**is).count();
        if !self.has_effort {
            self.recording.effort.clear();
        } else if self.measured.contains(&true)
            && (unmeasured >= LEAST_ROWS || counts.unmeasured > 0)
        {
            self.recording.keep_measured(&self.measured);
        }
        self.recording.leave_out_stale();
        Ok(self.recording)
    }
}
