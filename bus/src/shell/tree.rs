//! Run loop of a stage group: a source, or a stage that receives from a link, and all stages behind it in one thread.
//! The group is a tree, because each stage has one input.
//!
//! A sample is passed in place to the stages that receive it, one after the other, as soon as it is emitted. There is
//! no queue, no other thread, and no memory allocation. Only then is it sent over links.

mod node;
mod root;
mod turn;

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use super::report::{Outcome, Poster, Report};
use super::{Context, Ledger, TAKEN_WITHIN};
use crate::link::{LinkError, Receiver, Sender};
use crate::sample::{Health, Sample};
use crate::stage::{Source, StageError};

pub use node::{Branch, Outlet, branch};
pub use turn::Turn;

use node::walk;
use root::{Linked, Root, SourceRoot};

/// Interval at which the wait for receivers checks for a stop request.
/// Resolution: delay of a stop.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Parts of a stage in a group, in addition to its streams of samples.
pub struct Post<'a> {
    /// Name of the stage.
    pub stage: String,
    /// Number of restarts of the stage.
    pub restarts: u64,
    /// Name of the stage whose stream it receives; empty for a source.
    pub from: String,
    /// Sender of its health reports.
    pub health: Box<dyn Sender<Health> + 'a>,
    /// Counters that survive a crash.
    pub ledger: Ledger,
}

/// Opens the input link of a group, once all receivers of the group are connected.
pub type Opening<'a, I> = Box<dyn FnOnce() -> Result<Box<dyn Receiver<I> + 'a>, LinkError> + 'a>;

/// A stage group: stages that run in one thread.
pub struct Tree<'a> {
    turn: Turn,
    root: Box<dyn Root + 'a>,
}

impl<'a> Tree<'a> {
    /// A group that starts with a source.
    pub fn of_source<T: Sample>(
        turn: &Turn,
        post: Post<'a>,
        source: Box<dyn Source<T> + 'a>,
        out: Outlet<'a, T>,
    ) -> Self {
        Self {
            turn: turn.clone(),
            root: Box::new(SourceRoot::new(turn, post, source, out)),
        }
    }

    /// A group whose first stage receives from a link.
    pub fn of_link<I: Sample>(
        turn: &Turn,
        first: Box<dyn Branch<I> + 'a>,
        open: Opening<'a, I>,
    ) -> Self {
        Self {
            turn: turn.clone(),
            root: Box::new(Linked::new(first, open)),
        }
    }

    /// Waits at most `within` until all receivers of the group are connected, and reports the number of missing ones
    /// for each stage. Then opens the input link.
    ///
    /// # Errors
    /// If a link fails or cannot be opened.
    pub fn begin(
        &mut self,
        context: &Context,
        within: Duration,
        ready: &mut dyn FnMut(&str, usize),
    ) -> Result<(), LinkError> {
        let deadline = Instant::now() + within;
        walk(self.root.part(), &mut |part| {
            let missing = loop {
                let left = deadline.saturating_duration_since(Instant::now());
                let missing = part.wait_for_receivers(left.min(LOOK_EVERY))?;
                if missing == 0 || left.is_zero() || context.stop.is_stopped() {
                    break missing;
                }
            };
            let stage = &part.report().stage;
            if missing > 0 && !context.stop.is_stopped() {
                tracing::warn!(stage, missing, ?within, "receivers are not there");
            }
            ready(stage, missing);
            Ok(())
        })?;
        self.open()
    }

    /// Opens the input link without waiting for receivers.
    ///
    /// # Errors
    /// If the link cannot be opened.
    pub(super) fn open(&mut self) -> Result<(), LinkError> {
        self.root.open()
    }

    /// Runs until the source or the input link ends, or a stop is requested. If a stage fails or panics, no stream of
    /// the group gets an end, so that the group can be restarted.
    pub fn run(mut self, context: &Context) -> Vec<Report> {
        let driven = catch_unwind(AssertUnwindSafe(|| self.drive(context)));
        let (stage, outcome) = match driven {
            Ok(Ok(outcome)) => {
                let mut reports = self.reports();
                // A stop request stops the first stage only; the others end with their input.
                for (place, report) in reports.iter_mut().enumerate() {
                    let outcome = if place == 0 {
                        &outcome
                    } else {
                        &Outcome::Ended
                    };
                    report.outcome = Some(outcome.clone());
                }
                context.board.post(&reports);
                return reports;
            }
            Ok(Err(error)) => {
                let (stage, error) = self.turn.failure(error);
                (stage, Outcome::of(&error))
            }
            Err(panic) => (
                self.turn.whose(),
                Outcome::Failed(format!("it panicked: {}", words_of(&*panic))),
            ),
        };
        let counted = catch_unwind(AssertUnwindSafe(|| self.reports()));
        let mut reports = counted.unwrap_or_else(|_| context.board.read());
        fell(&mut reports, &stage, &outcome);
        context.board.post(&reports);
        reports
    }

    fn drive(&mut self, context: &Context) -> Result<Outcome, StageError> {
        context.board.follow(self.turn.pulse());
        let mut poster = Poster::new(context.board.clone());
        poster.post(&self.reports());
        let outcome = loop {
            let ended = self.root.turn(context.stop.is_stopped())?;
            self.turn.check()?;
            if let Some(outcome) = ended {
                break outcome;
            }
            if poster.is_due() {
                poster.post(&self.reports());
            }
        };
        context.board.ends();
        self.root.part().finish()?;
        self.turn.check()?;
        walk(self.root.part(), &mut |part| {
            part.wait_until_taken(TAKEN_WITHIN)
        })?;
        Ok(outcome)
    }

    /// Reports of all stages in the order of the group, beginning with the first stage.
    fn reports(&mut self) -> Vec<Report> {
        let mut reports = Vec::new();
        self.root.count();
        // Counting cannot fail.
        let _ = walk(self.root.part(), &mut |part| {
            part.count();
            reports.push(part.report().clone());
            Ok(())
        });
        reports
    }
}

/// Sets the outcomes of a group in which one stage has failed and the others end with it.
pub(super) fn fell(reports: &mut [Report], stage: &str, outcome: &Outcome) {
    for report in reports {
        report.outcome = Some(if report.stage == stage {
            outcome.clone()
        } else {
            Outcome::with(stage)
        });
    }
}

/// Message of a panic.
pub(super) fn words_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message")
}
