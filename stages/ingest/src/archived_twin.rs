//! Reads a twin's efforts and residuals back from an archive, so that detectors can be run on the recorded twin.

use std::collections::VecDeque;
use std::path::Path;

use tauscope_archive::{ArchiveError, Damage, Messages, ros};
use tauscope_bus::{Emit, JointArray, MAX_JOINTS, Progress, Source, StageError, TwinState, flags};
use tauscope_dynamics::derivative::FilteredDerivative;

use crate::config::{Config, FileConfig, Topics};
use crate::error::IngestError;
use crate::pack::MAX_GAP_NS;
use crate::recorded::RecordedSource;
use crate::setup::Setup;

/// Maximum number of residuals that wait for their joint state.
/// Resolution: memory; about 0.25 s at 1 kHz.
const LOOK_AHEAD: usize = 256;
/// Number of samples emitted per step.
/// Resolution: latency of a stop, against the cost of a step.
const SAMPLES_PER_STEP: usize = 16;

/// Topics of a twin in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArchivedTwinTopics {
    /// Measured joint states.
    pub state: String,
    /// Expected efforts, not filtered.
    pub twin: String,
    /// Residuals, recorded once the twin's filters have settled.
    pub residual: String,
}

impl Default for ArchivedTwinTopics {
    fn default() -> Self {
        Self {
            state: "/joint_states".to_owned(),
            twin: "/twin/joint_states".to_owned(),
            residual: "/residual".to_owned(),
        }
    }
}

/// Source of the twin states in an archive.
///
/// The joint state, the expected effort and the residual of one stamp make one [`TwinState`], with the flag `READY`
/// if there is a residual. The archive holds only the difference of the filtered efforts. So
/// `filtered_expected_effort` is the unfiltered expected effort, and `filtered_effort` is that plus the residual.
pub struct ArchivedTwin {
    states: RecordedSource,
    residuals: Messages,
    message: ros::JointState,
    joint_names: Vec<String>,
    /// Residuals by stamp whose joint state has not been read yet.
    waiting: VecDeque<(i64, JointArray)>,
    acceleration: Vec<FilteredDerivative>,
    previous_ns: Option<i64>,
    refused: u64,
    damage: Vec<Damage>,
}

impl std::fmt::Debug for ArchivedTwin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ArchivedTwin")
            .field("states", &self.states)
            .field("refused", &self.refused)
            .finish_non_exhaustive()
    }
}

impl ArchivedTwin {
    /// Opens the archive at `path`. `config` has the settings for differentiating a missing velocity.
    ///
    /// # Errors
    /// If the archive cannot be read, or lacks one of the topics.
    pub fn open(
        path: &Path,
        topics: &ArchivedTwinTopics,
        config: &Config,
        setup: &Setup,
    ) -> Result<Self, IngestError> {
        let file = FileConfig {
            path: path.to_owned(),
            topics: Topics {
                state: topics.state.clone(),
                twin: Some(topics.twin.clone()),
                ..Topics::default()
            },
        };
        let states = RecordedSource::open_file(&file, config, setup)?;
        let recording = tauscope_session::open(path)?;
        recording.topic_of::<ros::JointState>(&topics.residual)?;
        let derivative = FilteredDerivative::new(config.velocity_cutoff_hz);
        Ok(Self {
            states,
            residuals: recording.messages(&[&topics.residual])?,
            message: ros::JointState::default(),
            joint_names: setup.joint_names.clone(),
            waiting: VecDeque::with_capacity(LOOK_AHEAD),
            acceleration: vec![derivative; setup.joint_names.len()],
            previous_ns: None,
            refused: 0,
            damage: Vec::new(),
        })
    }

    /// Returns the residual of this instant, if the archive has one.
    fn residual(&mut self, stamp_ns: i64) -> Result<Option<JointArray>, IngestError> {
        while self
            .waiting
            .back()
            .is_none_or(|(newest, _)| *newest < stamp_ns)
        {
            if !self.read_residual()? {
                break;
            }
        }
        while self
            .waiting
            .front()
            .is_some_and(|(oldest, _)| *oldest < stamp_ns)
        {
            // A residual without a joint state: the topics are not those of one twin.
            self.waiting.pop_front();
            self.refused += 1;
        }
        if self
            .waiting
            .front()
            .is_some_and(|(oldest, _)| *oldest == stamp_ns)
        {
            return Ok(self.waiting.pop_front().map(|(_, residual)| residual));
        }
        Ok(None)
    }

    /// Reads one more residual; returns `false` at the end, or if too many wait.
    fn read_residual(&mut self) -> Result<bool, IngestError> {
        if self.waiting.len() >= LOOK_AHEAD {
            return Ok(false);
        }
        let message = match self.residuals.next_message() {
            None => return Ok(false),
            Some(Err(ArchiveError::Damaged(damage))) => {
                if !self.damage.contains(&damage) {
                    self.damage.push(damage);
                }
                return Ok(true);
            }
            Some(other) => other?,
        };
        message.decode_into(&mut self.message)?;
        let mut residual = [0.0; MAX_JOINTS];
        for (name, value) in self.message.name.iter().zip(&self.message.effort) {
            if let Some(j) = self.joint_names.iter().position(|joint| joint == name) {
                residual[j] = *value;
            }
        }
        self.waiting
            .push_back((self.message.header.stamp.ns(), residual));
        Ok(true)
    }

    fn accelerate(&mut self, stamp_ns: i64, velocity: &JointArray) -> JointArray {
        let step_ns = self.previous_ns.map(|before| stamp_ns - before);
        self.previous_ns = Some(stamp_ns);
        let mut acceleration = [0.0; MAX_JOINTS];
        for (j, filter) in self.acceleration.iter_mut().enumerate() {
            match step_ns {
                Some(step_ns) if (0..=MAX_GAP_NS).contains(&step_ns) => {
                    acceleration[j] = filter.update(step_ns as f64 * 1e-9, velocity[j]);
                }
                _ => filter.reset(velocity[j]),
            }
        }
        acceleration
    }

    fn next_state(&mut self) -> Result<Option<TwinState>, IngestError> {
        let Some(sample) = self.states.next_packed()? else {
            return Ok(None);
        };
        let stamp_ns = sample.header.stamp_ns;
        let residual = self.residual(stamp_ns)?;
        let mut state = TwinState {
            header: sample.header,
            position: sample.position,
            velocity: sample.velocity,
            acceleration: self.accelerate(stamp_ns, &sample.velocity),
            effort: sample.effort,
            expected_effort: sample.reference_effort,
            filtered_effort: sample.reference_effort,
            filtered_expected_effort: sample.reference_effort,
            ..TwinState::default()
        };
        if let Some(residual) = residual {
            state.header.flags |= flags::READY;
            state.residual = residual;
            for (filtered, difference) in state.filtered_effort.iter_mut().zip(residual) {
                *filtered += difference;
            }
        }
        Ok(Some(state))
    }
}

impl Source<TwinState> for ArchivedTwin {
    fn step(&mut self, out: &mut dyn Emit<TwinState>) -> Result<Progress, StageError> {
        for _ in 0..SAMPLES_PER_STEP {
            match self.next_state().map_err(StageError::failed)? {
                Some(state) => out.emit(&mut |slot| *slot = state)?,
                None => return Ok(Progress::End),
            }
        }
        Ok(Progress::More)
    }

    fn dropped(&self) -> u64 {
        let torn = self.damage.iter().filter(|part| part.loses_data()).count();
        self.states.dropped() + self.refused + torn as u64
    }

    fn fraction_done(&self) -> Option<f64> {
        self.states.fraction_done()
    }
}
