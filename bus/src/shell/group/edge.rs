//! The nodes of a group as their connections see them.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;
use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use crate::link::{LinkError, Position, ReceiverCounts};
use crate::sample::{SampleKind, SampleRef};
use crate::shell::report::Report;
use crate::stage::{Progress, StageError};

/// A node that several connections share.
pub(super) type Shared<'a> = Rc<RefCell<dyn Part<'a> + 'a>>;

/// A connection to an input of a node of the same group.
pub(super) struct Edge<'a> {
    pub input: usize,
    to: Shared<'a>,
    /// Kind that the node accepts; `None` for all.
    pub accepts: Option<SampleKind>,
}

impl<'a> Edge<'a> {
    pub fn new(input: usize, to: Shared<'a>, accepts: Option<SampleKind>) -> Self {
        Self { input, to, accepts }
    }

    /// The node. The nodes of a group form no cycle, so none is borrowed twice.
    pub fn to(&self) -> RefMut<'_, dyn Part<'a> + 'a> {
        self.to.borrow_mut()
    }
}

/// A node in its group, independent of its sample types.
pub(super) trait Part<'a> {
    /// Adds a receiver of its stream.
    fn attach(&mut self, edge: Edge<'a>) -> Result<(), LinkError>;

    /// Adds a receiver of its health reports.
    fn attach_health(&mut self, edge: Edge<'a>) -> Result<(), LinkError>;

    /// See [`Source::register`](crate::Source::register).
    fn register(&mut self, waker: &Waker);

    /// Makes a step of a source.
    fn step(&mut self) -> Result<Progress, StageError>;

    /// Processes a sample of an input.
    fn accept(&mut self, input: usize, sample: SampleRef<'_>) -> Result<(), LinkError>;

    /// Sends a health report if one is due.
    fn tell(&mut self) -> Result<(), LinkError>;

    /// Takes over the counters of a link.
    fn count_link(&mut self, input: usize, counts: ReceiverCounts, position: Option<Position>);

    /// Closes an input, because its stream has `ended` or a stop was requested. Finishes with the last one.
    fn close(&mut self, input: usize, ended: bool) -> Result<(), StageError>;

    /// Marks it as stopped before the end of its inputs.
    fn stop(&mut self);

    /// Finishes the stage and ends its stream.
    fn finish(&mut self) -> Result<(), StageError>;

    /// See [`Group::maintain`](super::Group::maintain).
    fn maintain(&mut self, now: Instant) -> Result<(), StageError>;

    fn fraction_done(&self) -> Option<f64>;

    /// Updates the report.
    fn count(&mut self);

    /// The report as of the last update.
    fn report(&self) -> &Report;

    /// Number of receivers over links that are not connected.
    fn missing_receivers(&mut self) -> Result<usize, LinkError>;

    /// See [`Sender::poll_taken`].
    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<()>, LinkError>;
}
