//! Joint states from a recording: MCAP, a rosbag2 bag, a bag of ROS 1, a table, or an episode of a LeRobot data set.

use std::path::{Path, PathBuf};

use tauscope_archive::{ArchiveError, Damage, Messages, Recording, ros};
use tauscope_bus::command::Request;
use tauscope_bus::{Emit, JointState, Progress, Source, StageError};
use tauscope_session::{Assembler, Counts, Joints, Look};

use crate::config::{Config, CsvConfig, FileConfig, Topics};
use crate::error::IngestError;
use crate::findings::Findings;
use crate::pack::{PackSettings, Packer};
use crate::setup::Setup;

/// Longest wait of a sample for the command of its instant \[ns of log time\].
/// Chosen: messages of one instant are logged within less, even over a busy network; longer only costs memory.
const WAIT_NS: i64 = 100_000_000;
/// Maximum number of messages read per step.
/// Resolution: latency of a stop, against the cost of a step.
const MESSAGES_PER_STEP: usize = 512;
/// Number of samples emitted per step.
/// Resolution: latency of a stop, against the cost of a step.
const SAMPLES_PER_STEP: usize = 16;

/// Part of a sample that a topic supplies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Role {
    State,
    Command,
    Reference,
    Tool,
    Learn,
    Told,
}

/// A source that reads a recording once from beginning to end, in memory that does not grow with its
/// size.
pub struct RecordedSource {
    path: PathBuf,
    messages: Messages,
    /// Role of each topic, by its index in the recording.
    roles: Vec<Option<Role>>,
    packer: Packer,
    first: Option<JointState>,
    message: ros::JointState,
    decoder: ros::JointStateDecoder,
    tool: ros::InertiaStamped,
    learn: ros::Bool,
    told: ros::DiagnosticArray,
    log_times_ns: (i64, i64),
    now_ns: i64,
    ended: bool,
    findings: Findings,
    /// Whether the findings are reported elsewhere, so that they need not be logged.
    reported_elsewhere: bool,
    damage: Vec<Damage>,
    undecodable: u64,
}

impl std::fmt::Debug for RecordedSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RecordedSource")
            .field("path", &self.path)
            .field("counts", &self.packer.counts())
            .finish_non_exhaustive()
    }
}

impl RecordedSource {
    /// Opens the recording that `file` names, and reads up to its first sample.
    ///
    /// # Errors
    /// If it cannot be read, a topic is missing, or it holds no sample of this cell: no message
    /// names a joint, or a joint is NaN throughout.
    pub fn open_file(
        file: &FileConfig,
        config: &Config,
        setup: &Setup,
    ) -> Result<Self, IngestError> {
        let recording = tauscope_session::open(&file.path)?;
        Self::open(&recording, (&file.topics, config), setup, Look::assembler)
    }

    /// Like [`RecordedSource::open_file`], for learning: samples after a backward jump of the stamps are refused.
    ///
    /// # Errors
    /// As [`RecordedSource::open_file`].
    pub fn open_to_learn(
        file: &FileConfig,
        config: &Config,
        setup: &Setup,
    ) -> Result<Self, IngestError> {
        let recording = tauscope_session::open(&file.path)?;
        let assembler = |look: &Look| look.assembler().refusing_set_back();
        Self::open(&recording, (&file.topics, config), setup, assembler)
    }

    /// Opens the table that `csv` names, and reads up to its first sample.
    ///
    /// # Errors
    /// As [`RecordedSource::open_file`]; an error in the table is reported with its line.
    pub fn open_csv(csv: &CsvConfig, config: &Config, setup: &Setup) -> Result<Self, IngestError> {
        let recording = tauscope_session::open_table(&csv.path, &csv.columns, &setup.joint_names)?;
        let topics = Topics::default();
        Self::open(&recording, (&topics, config), setup, Look::assembler)
    }

    fn open(
        recording: &Recording,
        (topics, config): (&Topics, &Config),
        setup: &Setup,
        assembler: impl FnOnce(&Look) -> Assembler,
    ) -> Result<Self, IngestError> {
        let (roles, wanted) = roles(recording, topics)?;
        let joints = Joints {
            names: &setup.joint_names,
            effort_limits: &setup.effort_limits,
        };
        let look = Look::at(recording, Some(&topics.state), joints)?;
        let named = |topic: &Option<String>| topic.is_some();
        let settings = PackSettings {
            velocity_cutoff_hz: config.velocity_cutoff_hz,
            max_age_ns: (config.max_age_s * 1e9) as i64,
            wait_ns: WAIT_NS,
            expects_command: named(&topics.command),
            expects_reference: named(&topics.twin),
        };
        let log_times_ns = (
            recording.start_ns().unwrap_or(0),
            recording.end_ns().unwrap_or(0),
        );
        let mut source = Self {
            path: recording.path().to_owned(),
            messages: recording.messages(&wanted)?,
            roles,
            packer: Packer::with(setup, settings, |_| assembler(&look))?,
            first: None,
            message: ros::JointState::default(),
            decoder: ros::JointStateDecoder::default(),
            tool: ros::InertiaStamped::default(),
            learn: ros::Bool::default(),
            told: ros::DiagnosticArray::default(),
            log_times_ns,
            now_ns: log_times_ns.0,
            ended: false,
            findings: Findings::default(),
            reported_elsewhere: false,
            damage: recording.damage().to_vec(),
            undecodable: 0,
        };
        for damage in &source.damage {
            tracing::warn!("{damage}");
        }
        // Read up to the first sample, so that faults of the whole recording are reported before any stage starts.
        while source.first.is_none() {
            source.first = source.next_sample(usize::MAX)?;
            if source.ended && source.first.is_none() {
                source.packer.verdict().map_err(|error| IngestError::Pack {
                    origin: source.path.display().to_string(),
                    source: error,
                })?;
            }
        }
        Ok(source)
    }

    /// Returns the path of the recording.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns a handle to the findings; the caller reports them. Without this call they are logged at the end.
    pub fn findings(&mut self) -> Findings {
        self.reported_elsewhere = true;
        self.findings.clone()
    }

    /// Returns the counts of packed and refused messages.
    pub fn counts(&self) -> Counts {
        self.packer.counts()
    }

    /// Returns the parts of the recording that could not be read so far.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// Returns the number of messages so far that cannot be decoded as their topic's type.
    pub fn undecodable(&self) -> u64 {
        self.undecodable
    }

    /// Returns the next sample; `None` at the end.
    ///
    /// # Errors
    /// If the recording cannot be read any further.
    pub fn next_packed(&mut self) -> Result<Option<JointState>, IngestError> {
        match self.first.take() {
            Some(first) => Ok(Some(first)),
            None => self.next_sample(usize::MAX),
        }
    }

    fn next_sample(&mut self, limit: usize) -> Result<Option<JointState>, IngestError> {
        self.read_on(limit)?;
        Ok(self.packer.pop(self.now_ns))
    }

    /// Reads at most `limit` messages until a sample is due; returns whether one is.
    fn read_on(&mut self, limit: usize) -> Result<bool, IngestError> {
        let mut read = 0;
        loop {
            if self.packer.is_due(self.now_ns) {
                return Ok(true);
            }
            if self.ended || read >= limit {
                return Ok(false);
            }
            self.read_message()?;
            read += 1;
        }
    }

    fn read_message(&mut self) -> Result<(), IngestError> {
        let message = match self.messages.next_message() {
            None => {
                self.ended = true;
                self.packer.flush();
                self.findings.set(self.packer.findings());
                return Ok(());
            }
            Some(Err(ArchiveError::Damaged(damage))) => {
                tracing::warn!("{damage}");
                if !self.damage.contains(&damage) {
                    self.damage.push(damage);
                }
                return Ok(());
            }
            Some(other) => other?,
        };
        self.now_ns = message.log_time_ns;
        let role = self.roles.get(message.topic_index).copied().flatten();
        let decoded = match role {
            None => return Ok(()),
            Some(Role::Tool) => message.decode_into(&mut self.tool),
            Some(Role::Learn) => message.decode_into(&mut self.learn),
            Some(Role::Told) => message.decode_into(&mut self.told),
            Some(_) => message.joint_state_into(&mut self.decoder, &mut self.message),
        };
        if let Err(error) = decoded {
            self.undecodable += 1;
            let reason = error.reason();
            if role == Some(Role::State) {
                self.packer.undecodable(&reason);
            } else {
                tracing::warn!("{error}");
            }
            return Ok(());
        }
        let (packer, now_ns) = (&mut self.packer, self.now_ns);
        match role {
            Some(Role::State) => packer.state(&self.message, now_ns),
            Some(Role::Command) => packer.command(&self.message, now_ns),
            Some(Role::Reference) => packer.reference(&self.message, now_ns),
            Some(Role::Tool) => packer.tool(&self.tool, now_ns),
            Some(Role::Learn) => packer.learn(self.learn),
            Some(Role::Told) => self.take_told(),
            None => {}
        }
        Ok(())
    }

    /// Logs the findings once, after the last message, unless they are reported elsewhere.
    fn log_findings(&mut self) {
        if !std::mem::replace(&mut self.reported_elsewhere, true) {
            for finding in self.findings.get() {
                tracing::warn!("{}: {finding}", self.path.display());
            }
        }
    }

    /// Takes the commands in a message of an archive. Entries that are not commands are logged and skipped.
    fn take_told(&mut self) {
        for status in &self.told.status {
            let argument = |name: &str| {
                let found = status.values.iter().find(|pair| pair.key == name);
                found.map(|pair| pair.value.as_str())
            };
            match Request::archived(&status.name, argument) {
                Ok(command) => self.packer.told(command),
                Err(refusal) => tracing::warn!("{}: {refusal}", self.path.display()),
            }
        }
    }
}

/// Returns the role of each topic of the recording, and the names of the topics to read.
fn roles<'a>(
    recording: &Recording,
    topics: &'a Topics,
) -> Result<(Vec<Option<Role>>, Vec<&'a str>), ArchiveError> {
    let mut wanted = vec![(topics.state.as_str(), Role::State)];
    for (topic, role) in [
        (&topics.command, Role::Command),
        (&topics.twin, Role::Reference),
        (&topics.tool, Role::Tool),
        (&topics.learn, Role::Learn),
        (&topics.commands, Role::Told),
    ] {
        wanted.extend(topic.as_deref().map(|name| (name, role)));
    }
    // A recording without requests lacks their topics, and a foreign topic may have the name of the commands' topic.
    let is_there = |name: &str| recording.topics().iter().any(|topic| topic.name == name);
    wanted.retain(|(name, role)| match role {
        Role::Learn => is_there(name),
        Role::Told => recording.topic_of::<ros::DiagnosticArray>(name).is_ok(),
        _ => true,
    });
    let mut roles = vec![None; recording.topics().len()];
    for &(name, role) in &wanted {
        let topic = match role {
            Role::Tool => recording.topic_of::<ros::InertiaStamped>(name)?,
            Role::Learn => recording.topic_of::<ros::Bool>(name)?,
            Role::Told => recording.topic_of::<ros::DiagnosticArray>(name)?,
            _ => recording.joint_state_topic(name)?,
        };
        if let Some(index) = recording.topics().iter().position(|each| each == topic) {
            roles[index] = Some(role);
        }
    }
    Ok((roles, wanted.into_iter().map(|(name, _)| name).collect()))
}

impl Source<JointState> for RecordedSource {
    fn step(&mut self, out: &mut dyn Emit<JointState>) -> Result<Progress, StageError> {
        for _ in 0..SAMPLES_PER_STEP {
            if let Some(first) = self.first.take() {
                out.emit(&mut |slot| *slot = first)?;
                continue;
            }
            let due = self.read_on(MESSAGES_PER_STEP);
            if !due.map_err(StageError::failed)? {
                if !self.ended {
                    return Ok(Progress::More);
                }
                self.log_findings();
                return Ok(Progress::End);
            }
            let packer = &mut self.packer;
            out.emit(&mut |slot| packer.pop_into(slot))?;
        }
        Ok(Progress::More)
    }

    fn dropped(&self) -> u64 {
        let torn = self.damage.iter().filter(|part| part.loses_data()).count();
        self.packer.counts().dropped() + self.undecodable + torn as u64
    }

    fn fraction_done(&self) -> Option<f64> {
        let (start_ns, end_ns) = self.log_times_ns;
        let whole = (end_ns - start_ns) as f64;
        if self.ended || whole <= 0.0 {
            return Some(1.0);
        }
        Some(((self.now_ns - start_ns) as f64 / whole).clamp(0.0, 1.0))
    }
}
