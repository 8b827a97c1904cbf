//! The loop around a tree: a source, or a stage that hears a link, and all stages of this process that hang on it.
//!
//! A sample is handed to the stages that hear it where it lies, as soon as it is emitted and one after the other. There
//! is no queue, no other thread, and no memory is allocated. Only then does it go to those who hear it over links.

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

/// How often the wait for receivers looks whether the tree is to stop.
/// Resolution: how soon a stop is noticed.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// What a stage of a tree has besides its streams of samples.
pub struct Post<'a> {
    /// The stage's name.
    pub stage: String,
    /// How often it has been started again.
    pub restarts: u64,
    /// The stage that it hears; empty for a source.
    pub from: String,
    /// Where its health reports go.
    pub health: Box<dyn Sender<Health> + 'a>,
    /// Where it keeps its counts.
    pub ledger: Ledger,
}

/// Opens the link that the first stage of a tree hears, once all who hear the tree are there.
pub type Opening<'a, I> = Box<dyn FnOnce() -> Result<Box<dyn Receiver<I> + 'a>, LinkError> + 'a>;

/// Stages of one thread.
pub struct Tree<'a> {
    turn: Turn,
    root: Box<dyn Root + 'a>,
}

impl<'a> Tree<'a> {
    /// A tree that grows from a source.
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

    /// A tree that grows from a link.
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

    /// Waits until all who hear the tree are there, no longer than `within`, and says by stage how many are missing.
    /// Then the tree hears, too.
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

    /// Hears without waiting for who hears it.
    ///
    /// # Errors
    /// If the link cannot be opened.
    pub(super) fn open(&mut self) -> Result<(), LinkError> {
        self.root.open()
    }

    /// Runs until its source or its link ends, or it is told to stop. Where one of its stages fails or panics, none of
    /// its streams gets an end: the tree may be started again.
    pub fn run(mut self, context: &Context) -> Vec<Report> {
        let driven = catch_unwind(AssertUnwindSafe(|| self.drive(context)));
        let (stage, outcome) = match driven {
            Ok(Ok(outcome)) => {
                let mut reports = self.reports();
                // Only the first hears whether it is to stop; for the others a stream ends.
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
        let deadline = Instant::now() + TAKEN_WITHIN;
        walk(self.root.part(), &mut |part| {
            part.wait_until_taken(deadline)
        })?;
        Ok(outcome)
    }

    /// What each stage has done, in the order of the tree, the first one first.
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

/// Says in the reports of a tree that one of its stages failed, and the others with it.
pub(super) fn fell(reports: &mut [Report], stage: &str, outcome: &Outcome) {
    for report in reports {
        report.outcome = Some(if report.stage == stage {
            outcome.clone()
        } else {
            Outcome::with(stage)
        });
    }
}

/// What a panic says.
pub(super) fn words_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("it says nothing of why")
}
