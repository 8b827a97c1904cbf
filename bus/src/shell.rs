//! Shells: the loops around a source, a stage or a sink that feed it, count, report its health and
//! pass the end of the stream on.
//!
//! - [`run_source`], [`run_stage`], [`run_sink`] run one over links that are open; they return a
//!   [`Report`] however it ends.
//! - [`Tree`] is the loop around a source or a link and all stages that hang on it in one process; [`crew`] runs any
//!   number of trees in one process.
//! - [`child`] runs a stage in a process of its own, which takes its [`Seat`](crate::Seat) from standard
//!   input; [`outside`] is all that the `main` of a stage from another crate needs.

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

/// How long a shell waits for a sample before it looks whether it is to stop.
/// Resolution: how soon a stop is noticed, against how often the stage wakes up.
const TICK: Duration = Duration::from_millis(100);
/// How long a stage that has ended stays for receivers that have not read all of its stream yet.
/// Resolution: how long the end of a run may take.
const TAKEN_WITHIN: Duration = Duration::from_secs(10);

/// Tells a shell to stop. Clones are one.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Nobody is to stop yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The shell deals with what has arrived, completes its output and returns.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it is to stop.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What every shell needs besides the stage and its links.
#[derive(Debug, Clone, Default)]
pub struct Context {
    /// The stage's name.
    pub stage: String,
    /// How often it has been started again.
    pub restarts: u64,
    /// Ends it.
    pub stop: Stop,
    /// Where others see how it fares.
    pub board: Board,
}

impl Context {
    /// For the stage of that name, started for the first time.
    pub fn new(stage: &str) -> Self {
        Self {
            stage: stage.to_owned(),
            ..Self::default()
        }
    }
}
