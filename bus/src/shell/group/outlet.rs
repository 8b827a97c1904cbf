//! Output of a node: to the nodes of its group that receive it, and over links to all others.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;
use std::task::Poll;
use std::time::Duration;

use super::member::Part;
use super::mismatch;
use crate::link::{LinkError, Sender, SenderCounts};
use crate::sample::{Header, Sample, SampleKind};
use crate::shell::Ledger;
use crate::shell::pulse::Pulse;
use crate::stage::{Emit, StageError};

/// A connection to an input of a node of the same group.
pub(super) struct Edge<'a> {
    input: usize,
    to: Rc<RefCell<dyn Part<'a> + 'a>>,
    /// Kind that the node accepts; `None` for all.
    accepts: Option<SampleKind>,
}

impl<'a> Edge<'a> {
    pub fn new(
        input: usize,
        to: Rc<RefCell<dyn Part<'a> + 'a>>,
        accepts: Option<SampleKind>,
    ) -> Self {
        Self { input, to, accepts }
    }

    /// Index of the input.
    pub fn input(&self) -> usize {
        self.input
    }

    /// The node. The nodes of a group form no cycle, so none is borrowed twice.
    pub fn to(&self) -> RefMut<'_, dyn Part<'a> + 'a> {
        self.to.borrow_mut()
    }
}

pub(super) struct Outlet<'a, T: Sample> {
    edges: Vec<Edge<'a>>,
    /// `None` without receivers outside the group.
    link: Option<Box<dyn Sender<T>>>,
    slot: T,
    sent: u64,
    newest: Option<Header>,
    ledger: Ledger,
    pulse: Pulse,
}

impl<'a, T: Sample> Outlet<'a, T> {
    pub fn new(link: Option<Box<dyn Sender<T>>>, ledger: Ledger, pulse: Pulse) -> Self {
        Self {
            edges: Vec::new(),
            link,
            slot: T::default(),
            sent: 0,
            newest: None,
            ledger,
            pulse,
        }
    }

    /// Adds a receiver of this group to the stream of `stage`.
    pub fn attach(&mut self, stage: &str, edge: Edge<'a>) -> Result<(), LinkError> {
        if let Some(kind) = edge.accepts.filter(|kind| *kind != T::KIND) {
            return Err(mismatch(stage, kind, Some(T::KIND)));
        }
        match edge.accepts {
            Some(_) => self.edges.push(edge),
            None => self.edges.insert(0, edge),
        }
        Ok(())
    }

    /// Takes the header of the newest sample emitted since the last call.
    pub fn take_newest(&mut self) -> Option<Header> {
        self.newest.take()
    }

    pub fn counts(&self) -> SenderCounts {
        let link = self.link.as_ref().map(Sender::counts).unwrap_or_default();
        SenderCounts {
            sent: self.sent,
            undelivered: link.undelivered,
        }
    }

    pub fn missing_receivers(&mut self) -> Result<usize, LinkError> {
        let link = self.link.as_mut();
        link.map_or(Ok(0), |link| link.wait_for_receivers(Duration::ZERO))
    }

    pub fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        let link = self.link.as_mut();
        link.map_or(Ok(Poll::Ready(0)), |link| link.poll_taken(timeout))
    }

    /// Ends the stream for all receivers.
    pub fn end(&mut self) -> Result<(), StageError> {
        if let Some(link) = &mut self.link {
            link.end()?;
        }
        let mut edges = self.edges.iter();
        edges.try_for_each(|edge| edge.to().close(edge.input, true))
    }
}

impl<T: Sample> Emit<T> for Outlet<'_, T> {
    fn emit(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let Self {
            edges,
            link,
            slot,
            sent,
            newest,
            ledger,
            pulse,
        } = self;
        if let (Some(link), true) = (&mut *link, edges.is_empty()) {
            pulse.waiting(|| {
                link.send_with(&mut |place| {
                    write(place);
                    *newest = Some(*place.header());
                    ledger.emitted(*sent + 1, place.header());
                })
            })?;
            *sent += 1;
            return Ok(());
        }
        *slot = T::default();
        write(slot);
        slot.header_mut().sequence = *sent;
        *newest = Some(*slot.header());
        *sent += 1;
        ledger.emitted(*sent, slot.header());
        // Nodes of the group first: a detector must not wait for a recorder at the other end of the link.
        let heard = edges.iter().try_for_each(|edge| {
            let mut to = edge.to();
            to.accept(edge.input, slot.as_ref())?;
            to.tell()
        });
        if let Some(link) = link {
            pulse.waiting(|| link.send_with(&mut |place| *place = *slot))?;
        }
        heard
    }
}
