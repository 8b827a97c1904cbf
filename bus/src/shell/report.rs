//! Reports of stages, and the status board on which they are posted.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::link::{Position, ReceiverCounts, SenderCounts};
use crate::shell::heartbeat::Heartbeat;
use crate::stage::StageError;
use crate::trouble::Trouble;

/// End of the failure text of a stage that ends because another stage of its group has failed.
const OF_ANOTHER: &str = ", which runs with it, failed";

/// Report of a stage.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Report {
    /// Name of the stage.
    pub stage: String,
    /// Samples received; for a source, samples read.
    pub received: u64,
    /// Samples emitted.
    pub emitted: u64,
    /// Samples lost or refused at the inputs.
    pub lost: u64,
    /// Samples dropped by the stage itself.
    pub refused: u64,
    /// Samples that expected keep-all receivers did not get.
    pub undelivered: u64,
    /// Number of receivers that had not read to the end of the stream when the stage exited.
    pub untaken: usize,
    /// Stamp of the newest sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// Progress of a source of known length, from 0 to 1.
    pub fraction_done: Option<f64>,
    /// Reason why a source gives no usable data, while that lasts.
    #[serde(default)]
    pub trouble: Option<Trouble>,
    /// Files that a sink completed last.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// Number of files that a sink has completed.
    #[serde(default)]
    pub files_completed: u64,
    /// Reports of the inputs.
    pub inputs: Vec<InputReport>,
    /// Outcome of the stage; `None` while it runs.
    pub outcome: Option<Outcome>,
}

impl Report {
    /// Samples lost before or in the stage.
    pub fn dropped(&self) -> u64 {
        self.lost + self.refused
    }

    /// Whether all samples were processed and delivered.
    pub fn is_complete(&self) -> bool {
        self.dropped() == 0 && self.undelivered == 0 && self.untaken == 0
    }

    pub(super) fn count_output(&mut self, counts: SenderCounts) {
        self.emitted = counts.sent;
        self.undelivered = counts.undelivered;
    }

    pub(super) fn count_inputs(&mut self) {
        self.received = self.inputs.iter().map(|input| input.counts.received).sum();
        let missing = |input: &InputReport| input.counts.lost.saturating_add(input.counts.refused);
        let missing = self.inputs.iter().map(missing);
        self.lost = missing.fold(0, u64::saturating_add);
    }
}

/// Report of one input of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct InputReport {
    /// Name of the stage that emits the stream.
    pub from: String,
    /// Counters of the receiving end.
    #[serde(flatten)]
    pub counts: ReceiverCounts,
    /// Position in the stream, for the seat of a restarted stage.
    pub position: Option<Position>,
    /// Whether the stream has ended.
    pub ended: bool,
}

/// Outcome of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// End of its inputs, or of the source itself.
    Ended,
    /// Stop on request.
    Stopped,
    /// Failure, with its cause.
    Failed(String),
    /// Input that does not match the configuration, with the reason; a restart would fail again.
    Unfit(String),
}

impl Outcome {
    /// Outcome of a stage that failed with this error.
    pub(super) fn of(error: &StageError) -> Self {
        let why = text_of(error);
        match error {
            StageError::Unfit(_) => Self::Unfit(why),
            StageError::Failed(_) | StageError::Link(_) => Self::Failed(why),
        }
    }

    /// Outcome of a stage that ended because `other`, of the same group, failed.
    pub(super) fn with(other: &str) -> Self {
        Self::Failed(format!("stage `{other}`{OF_ANOTHER}"))
    }

    /// Whether the stage ended because another stage of its group failed, whose report has the cause.
    pub fn is_of_another(&self) -> bool {
        self.failure().is_some_and(|why| why.ends_with(OF_ANOTHER))
    }

    /// Cause of a failure; `None` for other outcomes.
    pub fn failure(&self) -> Option<&str> {
        match self {
            Self::Failed(why) | Self::Unfit(why) => Some(why),
            Self::Ended | Self::Stopped => None,
        }
    }
}

/// Status board for the reports of a stage group, all of one instant. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Board(Arc<Mutex<Posted>>);

#[derive(Debug, Default)]
struct Posted {
    reports: Vec<Report>,
    at: Option<Instant>,
    heartbeat: Option<Heartbeat>,
    ends: bool,
}

impl Board {
    /// Time without a report after which a run loop that does not wait for a link is treated as hung.
    /// Resolution: ten reports are missing; a busy machine delays a few.
    const STUCK_AFTER: Duration = Duration::from_secs(1);

    /// The newest reports; empty before the run loop has started.
    pub fn read(&self) -> Vec<Report> {
        self.lock().reports.clone()
    }

    /// The hung stage and the time since the last report; `None` while the run loop works.
    pub fn stuck(&self, now: Instant) -> Option<(String, Duration)> {
        let posted = self.lock();
        let silent_for = now.saturating_duration_since(posted.at?);
        let waits = posted.heartbeat.as_ref().is_some_and(Heartbeat::waits);
        let over = posted.reports.iter().any(|report| report.outcome.is_some());
        if silent_for < Self::STUCK_AFTER || waits || over || posted.ends {
            return None;
        }
        // Without a heartbeat there is one stage.
        let stage = match &posted.heartbeat {
            Some(heartbeat) => heartbeat.current_stage(),
            None => posted.reports.first()?.stage.clone(),
        };
        Some((stage, silent_for))
    }

    /// Sets the heartbeat that names the current stage.
    pub(super) fn follow(&self, heartbeat: Heartbeat) {
        self.lock().heartbeat = Some(heartbeat);
    }

    /// Disables the hang detection: the end of a stage may take long, and those who wait for it have a timeout.
    pub(super) fn ends(&self) {
        self.lock().ends = true;
    }

    pub(super) fn post(&self, reports: &[Report]) {
        let mut posted = self.lock();
        reports.clone_into(&mut posted.reports);
        posted.at = Some(Instant::now());
    }

    fn lock(&self) -> MutexGuard<'_, Posted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An error and its causes, in one line.
pub(super) fn text_of(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let more = error.to_string();
        // Transparent errors repeat their source's text.
        if !text.ends_with(&more) {
            text.push_str(": ");
            text.push_str(&more);
        }
        cause = error.source();
    }
    text
}
