//! Execution of stages: stage groups, the event loops that run them, and the processes with these loops.
//!
//! - [`Group`] connects sources, stages and sinks and processes their samples. It does not wait, so a replay runs it,
//!   too. [`run`] runs one against the clock of the machine.
//! - [`worker`] is a process that runs any number of groups in a few event loops.
//! - [`child`] runs a stage in a process of its own, which reads its [`Seat`](crate::Seat) from standard
//!   input; [`outside`] is the complete `main` of a stage from another crate.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

pub mod child;
mod event_loop;
pub mod group;
mod health;
mod heartbeat;
mod ledger;
mod report;
mod worker;

pub use child::{Child, ChildError, Line, holds, note, outside};
pub use group::{Ends, Group, Input, Next, Node};
pub use ledger::{Account, Ledger};
pub use report::{Board, InputReport, Outcome, Report};
pub use worker::{Unmade, worker};

/// Interval of the reports of a running stage, and of its checks for a stop request; the work of a killed stage since
/// its last report is unknown.
/// Resolution: the cost of reporting.
const REPORT_EVERY: Duration = Duration::from_millis(100);
/// Longest time that a terminating stage waits, without progress, for receivers that have not read all of its stream.
/// Resolution: duration of a shutdown.
const TAKEN_WITHIN: Duration = Duration::from_secs(10);

/// Stop request to a stage group. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// A flag without a request yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Requests a stop: the group processes the samples that have arrived, completes its output and returns.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether a stop is requested.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Context of a stage group, in addition to its nodes and links.
#[derive(Debug, Clone, Default)]
pub struct Context {
    /// Name of its first stage.
    pub stage: String,
    /// Stop request.
    pub stop: Stop,
    /// Status board for the reports of its stages.
    pub board: Board,
}

impl Context {
    /// Context of a group whose first stage has this name.
    pub fn new(stage: &str) -> Self {
        Self {
            stage: stage.to_owned(),
            ..Self::default()
        }
    }
}

/// Runs nodes, each behind its inputs, to their ends in this thread.
///
/// # Errors
/// If the system has no more descriptors. The failure of a stage is in its report.
pub fn run(context: &Context, nodes: Vec<(Node<'_>, Ends)>) -> std::io::Result<Vec<Report>> {
    event_loop::run(context, Duration::ZERO, |_, _| {}, nodes)
}
