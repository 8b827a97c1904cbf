//! A stage group: sources, stages and sinks that one thread runs, with the connections between them.
//!
//! A sample is passed in place to all nodes that receive it, one after the other, as soon as it is emitted. There is
//! no queue, no other thread, and no memory allocation. Only then is it sent over links. The order of all outputs
//! depends on the inputs only.
//!
//! A group does not wait and has no clock: [`Group::turn`] processes what is there and says when to call it again. A
//! replay calls it in a loop; [`run`](super::run) and a [`worker`](super::worker) run groups against the clock of the
//! machine.

mod edge;
mod inlet;
mod member;
mod next;
mod node;
mod outlet;
mod turn;
mod work;

use std::cell::RefMut;
use std::os::fd::BorrowedFd;
use std::rc::Rc;
use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use super::Ledger;
use super::heartbeat::Heartbeat;
use super::report::{Outcome, Report};
use crate::link::{LinkError, Sender};
use crate::sample::Health;
use crate::seat::AnySender;
use crate::stage::{Progress, StageError};

pub use inlet::Opening;
pub use next::Next;
pub use node::Node;

use edge::{Edge, Part, Shared};
use inlet::Inlet;
use turn::Turn;

/// Largest number of samples of one input that are processed in one turn of a group.
/// Resolution: the delay of the other groups of the thread.
const BATCH: usize = 64;

/// An input of a node.
pub enum Input {
    /// The stream of another node of the group, which was added before.
    Of(String),
    /// The health reports of another node of the group, which was added before.
    HealthOf(String),
    /// A link that carries the stream of the stage `from`.
    Link {
        /// Name of the stage that emits the stream.
        from: String,
        /// Opens the link.
        open: Opening,
    },
}

/// The connections of a node, and what else belongs to its stage.
#[derive(Default)]
pub struct Ends {
    /// Name of the stage.
    pub stage: String,
    /// Number of restarts of the stage.
    pub restarts: u64,
    /// Its inputs.
    pub inputs: Vec<Input>,
    /// Sender of its stream to stages outside the group; `None` if there are none.
    pub output: Option<AnySender>,
    /// Sender of its health reports to stages outside the group.
    pub health: Option<Box<dyn Sender<Health>>>,
    /// Counters that survive a crash.
    pub ledger: Ledger,
}

impl Ends {
    /// The stage of that name with these inputs, without links.
    pub fn new(stage: &str, inputs: Vec<Input>) -> Self {
        Self {
            stage: stage.to_owned(),
            inputs,
            ..Self::default()
        }
    }
}

/// A stage group.
#[derive(Default)]
pub struct Group<'a> {
    turn: Turn,
    members: Vec<Shared<'a>>,
    /// The sources that have not ended, as indices of `members`.
    sources: Vec<usize>,
    /// The links that have not ended.
    inlets: Vec<Inlet<'a>>,
}

impl<'a> Group<'a> {
    /// A group whose nodes run under this heartbeat.
    pub(super) fn under(heartbeat: Heartbeat) -> Self {
        Self {
            turn: Turn::under(heartbeat),
            ..Self::default()
        }
    }

    /// Adds a node behind its inputs. The order in which nodes are added is the order in which they receive a sample,
    /// except that sinks come first: they get the samples in the order of emission.
    ///
    /// # Errors
    /// If an input or the output carries another type, or there is no such node.
    pub fn add(&mut self, node: Node<'a>, ends: Ends) -> Result<(), LinkError> {
        let Ends { inputs, stage, .. } = &ends;
        let names = inputs.iter().map(|input| match input {
            Input::Of(from) | Input::HealthOf(from) | Input::Link { from, .. } => from.clone(),
        });
        let (names, stage) = (names.collect(), stage.clone());
        let accepts = node.accepts();
        let is_source = node.is_source();
        let Ends {
            restarts,
            inputs,
            output,
            health,
            ledger,
            ..
        } = ends;
        let post = member::Post {
            stage,
            restarts,
            inputs: names,
            health,
            ledger,
        };
        let member = node.assemble(&self.turn, post, output)?;
        for (index, input) in inputs.into_iter().enumerate() {
            let edge = Edge::new(index, Rc::clone(&member), accepts);
            match input {
                Input::Of(from) => self.member(&from)?.attach(edge)?,
                Input::HealthOf(from) => self.member(&from)?.attach_health(edge)?,
                Input::Link { open, .. } => self.inlets.push(Inlet::new(edge, open)),
            }
        }
        if is_source {
            self.sources.push(self.members.len());
        }
        self.members.push(member);
        Ok(())
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.members.len()
    }

    /// Whether the group has no nodes.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    fn member(&self, name: &str) -> Result<RefMut<'_, dyn Part<'a> + 'a>, LinkError> {
        let mut members = self.members.iter().map(|member| member.borrow_mut());
        let found = members.find(|member| member.report().stage == name);
        found.ok_or_else(|| LinkError::Open {
            stream: name.to_owned(),
            transport: "in process",
            reason: "no stage of this group emits it".to_owned(),
        })
    }

    /// Opens the links, after the receivers of this group are connected.
    ///
    /// # Errors
    /// If a link cannot be opened.
    pub fn open(&mut self) -> Result<(), LinkError> {
        self.inlets.iter_mut().try_for_each(Inlet::open)
    }

    /// Asks all sources and links to wake this waker when they have samples. Returns the descriptors that are
    /// readable then instead.
    pub(super) fn register(&mut self, waker: &Waker) -> impl Iterator<Item = BorrowedFd<'_>> {
        for &source in &self.sources {
            self.members[source].borrow_mut().register(waker);
        }
        for inlet in &mut self.inlets {
            inlet.register(waker);
        }
        // Samples of a polled link are older than the urgent one that wakes the group.
        self.inlets.sort_by_key(Inlet::is_notified);
        self.inlets.iter().filter_map(Inlet::descriptor)
    }

    /// Lets each source make a step, and processes the samples that have arrived over links. After a stop request the
    /// sources end, and the links end once the samples that have arrived are processed.
    ///
    /// # Errors
    /// The failure of a node. The group cannot continue then, and no stream gets an end, so that the group can be
    /// restarted; [`Group::failure`] names the stage.
    pub fn turn(&mut self, stopped: bool) -> Result<Next, StageError> {
        let mut next = Next::Over;
        let (members, turn) = (&self.members, &self.turn);
        let mut failed = Ok(());
        self.sources.retain(|&source| {
            if failed.is_err() {
                return true;
            }
            let stepped = source_turn(&mut *members[source].borrow_mut(), stopped);
            let of_source = stepped.and_then(|next| turn.check().map(|()| next));
            let of_source = of_source.unwrap_or_else(|error| {
                failed = Err(error);
                Next::Now
            });
            next = next.or(of_source);
            of_source != Next::Over
        });
        failed?;
        for inlet in &mut self.inlets {
            next = next.or(inlet.turn(stopped, BATCH)?);
            turn.check()?;
        }
        self.inlets.retain(|inlet| !inlet.is_over());
        Ok(next)
    }

    /// Completed fraction of the sources of known length, 0 to 1.
    pub fn fraction_done(&self) -> f64 {
        let members = self.members.iter();
        let done = members.filter_map(|member| member.borrow_mut().fraction_done());
        done.fold(1.0, f64::min)
    }

    /// Reports of all nodes in the order in which they were added.
    pub fn reports(&self) -> Vec<Report> {
        let reports = self.members.iter().map(|member| {
            let mut member = member.borrow_mut();
            member.count();
            member.report().clone()
        });
        reports.collect()
    }

    /// Returns the stage that failed and its error; `error` is the one that [`Group::turn`] has returned.
    pub fn failure(&self, error: StageError) -> (String, StageError) {
        self.turn.failure(error)
    }

    /// Calls the idle sinks, and lets sources without samples say why.
    pub(super) fn maintain(&mut self, now: Instant) -> Result<(), StageError> {
        let mut members = self.members.iter();
        members.try_for_each(|member| member.borrow_mut().maintain(now))?;
        self.turn.check()
    }

    /// Number of receivers that are not connected, by stage.
    pub(super) fn missing_receivers(&mut self) -> Result<Vec<(String, usize)>, LinkError> {
        let missing = self.members.iter().map(|member| {
            let mut member = member.borrow_mut();
            let missing = member.missing_receivers()?;
            Ok((member.report().stage.clone(), missing))
        });
        missing.collect()
    }

    /// See [`Sender::poll_taken`]: ready once all receivers have read all streams to their ends.
    pub(super) fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<()>, LinkError> {
        let mut all = Poll::Ready(());
        for member in &self.members {
            if member.borrow_mut().poll_taken(timeout)?.is_pending() {
                all = Poll::Pending;
            }
        }
        Ok(all)
    }

    pub(super) fn heartbeat(&self) -> Heartbeat {
        self.turn.heartbeat()
    }

    /// Name of the node that runs, or that has panicked.
    pub(super) fn current_stage(&self) -> String {
        self.turn.current_stage()
    }
}

fn source_turn<'a>(source: &mut (dyn Part<'a> + 'a), stopped: bool) -> Result<Next, StageError> {
    let progress = if stopped {
        source.stop();
        Progress::End
    } else {
        source.step()?
    };
    Ok(match progress {
        Progress::More => Next::Now,
        Progress::Idle => Next::Woken,
        Progress::Until(at) => Next::At(at),
        Progress::End => {
            source.finish()?;
            Next::Over
        }
    })
}

/// Sets the outcomes of a group in which one stage has failed and the others end with it.
pub(super) fn set_failed(reports: &mut [Report], stage: &str, outcome: &Outcome) {
    for report in reports {
        report.outcome = Some(if report.stage == stage {
            outcome.clone()
        } else {
            Outcome::with(stage)
        });
    }
}
