//! How a stage fares.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use crate::link::{Position, ReceiverCounts, SenderCounts};
use crate::shell::pulse::Pulse;
use crate::stage::StageError;
use crate::trouble::Trouble;

/// What is said of the stage that failed, to those that end with it.
const OF_ANOTHER: &str = ", which runs with it, failed";

/// What a stage has done so far.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Report {
    /// The stage.
    pub stage: String,
    /// Samples that came in; for a source, those it has read.
    pub received: u64,
    /// Samples that went out.
    pub emitted: u64,
    /// Holes in the inputs, and what had to be refused there.
    pub lost: u64,
    /// Samples the stage itself had to drop.
    pub refused: u64,
    /// Samples that expected keep-all receivers did not get.
    pub undelivered: u64,
    /// Receivers that had not read to the end of the stream when the stage left.
    pub untaken: usize,
    /// Stamp of the newest sample \[ns since the epoch\].
    pub stamp_ns: i64,
    /// How far a source of known length is, from 0 to 1.
    pub fraction_done: Option<f64>,
    /// Why a source gives nothing that can be used, while it does not.
    #[serde(default)]
    pub trouble: Option<Trouble>,
    /// The files that a sink completed last.
    #[serde(default)]
    pub files: Vec<PathBuf>,
    /// How many files a sink has completed.
    #[serde(default)]
    pub files_completed: u64,
    /// Each input.
    pub inputs: Vec<InputReport>,
    /// How it ended; `None` while it runs.
    pub outcome: Option<Outcome>,
}

impl Report {
    /// Samples lost before or in the stage.
    pub fn dropped(&self) -> u64 {
        self.lost + self.refused
    }

    /// Whether all that it should have dealt with and passed on was.
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

/// One input of a stage.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct InputReport {
    /// The stage it comes from.
    pub from: String,
    /// What came and what did not.
    #[serde(flatten)]
    pub counts: ReceiverCounts,
    /// How far it has come; goes into the seat of the stage's next life.
    pub position: Option<Position>,
    /// Whether the stream has ended.
    pub ended: bool,
}

/// How a stage ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Its inputs, or the source itself, have ended.
    Ended,
    /// It was told to stop.
    Stopped,
    /// It could not go on; the text says why.
    Failed(String),
    /// Its input is not what it was configured for, and another life would end the same; the text says
    /// why.
    Unfit(String),
}

impl Outcome {
    /// Of a stage that could not go on.
    pub(super) fn of(error: &StageError) -> Self {
        let why = text_of(error);
        match error {
            StageError::Unfit(_) => Self::Unfit(why),
            StageError::Failed(_) | StageError::Link(_) => Self::Failed(why),
        }
    }

    /// Of a stage that ended because `other`, of the same tree, failed.
    pub(super) fn with(other: &str) -> Self {
        Self::Failed(format!("stage `{other}`{OF_ANOTHER}"))
    }

    /// Whether it could not go on because another stage of its tree failed, which says why.
    pub fn is_of_another(&self) -> bool {
        self.failure().is_some_and(|why| why.ends_with(OF_ANOTHER))
    }

    /// Why it could not go on, if it could not.
    pub fn failure(&self) -> Option<&str> {
        match self {
            Self::Failed(why) | Self::Unfit(why) => Some(why),
            Self::Ended | Self::Stopped => None,
        }
    }
}

/// Where stages that run together post their reports, all of one instant. Clones are one.
#[derive(Debug, Clone, Default)]
pub struct Board(Arc<Mutex<Posted>>);

#[derive(Debug, Default)]
struct Posted {
    reports: Vec<Report>,
    at: Option<Instant>,
    pulse: Option<Pulse>,
    ends: bool,
}

impl Board {
    /// A loop that has posted nothing for so long, and does not wait for a link, is stuck in one of its stages.
    /// Resolution: ten reports are missing; a busy machine delays a few.
    const STUCK_AFTER: Duration = Duration::from_secs(1);

    /// The newest reports; none until the loop has begun.
    pub fn read(&self) -> Vec<Report> {
        self.lock().reports.clone()
    }

    /// The stage that the loop is stuck in, and for how long; none while the loop goes round.
    pub fn stuck(&self, now: Instant) -> Option<(String, Duration)> {
        let posted = self.lock();
        let silent_for = now.saturating_duration_since(posted.at?);
        let waits = posted.pulse.as_ref().is_some_and(Pulse::waits);
        let over = posted.reports.iter().any(|report| report.outcome.is_some());
        if silent_for < Self::STUCK_AFTER || waits || over || posted.ends {
            return None;
        }
        // Without a tree there is one stage.
        let stage = match &posted.pulse {
            Some(pulse) => pulse.whose(),
            None => posted.reports.first()?.stage.clone(),
        };
        Some((stage, silent_for))
    }

    /// Whose turn it is tells this.
    pub(super) fn follow(&self, pulse: Pulse) {
        self.lock().pulse = Some(pulse);
    }

    /// What the stages do at their end may take long, and whoever waits for that has a patience of his own.
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

/// Posts now and then, not for every sample.
#[derive(Debug)]
pub(super) struct Poster {
    board: Board,
    posted: Instant,
}

impl Poster {
    /// Time between two reports.
    /// Resolution: the cost of reporting.
    const EVERY: Duration = Duration::from_millis(100);

    pub(super) fn new(board: Board) -> Self {
        Self {
            board,
            posted: Instant::now(),
        }
    }

    /// Whether it is time to bring a report up to date and post it.
    pub(super) fn is_due(&self) -> bool {
        self.posted.elapsed() >= Self::EVERY
    }

    pub(super) fn post(&mut self, reports: &[Report]) {
        self.board.post(reports);
        self.posted = Instant::now();
    }
}

/// An error and what it comes from, in one line.
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
