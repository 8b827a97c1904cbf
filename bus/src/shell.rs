//! Shells: the run loops around a source, a stage or a sink. They feed it, count samples, report its health and pass
//! on the end of the stream.
//!
//! - [`run_source`], [`run_stage`], [`run_sink`] run one stage over open links and return a [`Report`], also after a
//!   failure.
//! - [`Tree`] is the run loop of a stage group: a source or a link, and all stages behind it in one thread. [`crew`]
//!   runs any number of stage groups in one worker process.
//! - [`child`] runs a stage in a process of its own, which reads its [`Seat`](crate::Seat) from standard
//!   input; [`outside`] is the complete `main` of a stage from another crate.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub mod child;
mod crew;
mod health;
mod ledger;
mod pulse;
mod report;
mod single;
mod sink;
pub mod tree;

pub use child::{Child, ChildError, Line, holds, note, outside};
pub use crew::{Member, Unmade, crew};
pub use health::HealthClock;
pub use ledger::{Account, Ledger};
pub use report::{Board, InputReport, Outcome, Report};
pub use single::{run_source, run_stage};
pub use sink::{SinkInput, run_sink};
pub use tree::Tree;

/// Longest wait for a sample between two checks for a stop request.
/// Resolution: delay of a stop, against the number of wake-ups.
const TICK: Duration = Duration::from_millis(100);
/// Longest time that a terminating stage waits, without progress, for receivers that have not read all of its stream.
/// Resolution: duration of a shutdown.
const TAKEN_WITHIN: Duration = Duration::from_secs(10);

/// Stop request to a shell. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A flag without a request yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Requests a stop: the shell processes the samples that have arrived, completes its output and returns.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether a stop is requested.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Context of a shell, in addition to the stage and its links.
#[derive(Debug, Clone, Default)]
pub struct Context {
    /// Name of the stage.
    pub stage: String,
    /// Number of restarts of the stage.
    pub restarts: u64,
    /// Stop request.
    pub stop: Stop,
    /// Status board for the stage's reports.
    pub board: Board,
}

impl Context {
    /// Context of the stage of that name, without restarts.
    pub fn new(stage: &str) -> Self {
        Self {
            stage: stage.to_owned(),
            ..Self::default()
        }
    }
}
