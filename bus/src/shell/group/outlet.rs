//! Output of a node: to the nodes of its group that receive it, and over links to all others.

use std::task::Poll;
use std::time::Duration;

use super::edge::Edge;
use crate::link::{LinkError, Sender, SenderCounts};
use crate::sample::{Header, Sample};
use crate::shell::Ledger;
use crate::shell::heartbeat::Heartbeat;
use crate::stage::{Emit, StageError};

pub(super) struct Outlet<'a, T: Sample> {
    edges: Vec<Edge<'a>>,
    /// `None` without receivers outside the group.
    link: Option<Box<dyn Sender<T>>>,
    slot: T,
    sent: u64,
    newest: Option<Header>,
    ledger: Ledger,
    heartbeat: Heartbeat,
    /// Receivers over the link that have not taken the end, once that is known.
    untaken: Option<usize>,
}

impl<'a, T: Sample> Outlet<'a, T> {
    pub fn new(link: Option<Box<dyn Sender<T>>>, ledger: Ledger, heartbeat: Heartbeat) -> Self {
        Self {
            edges: Vec::new(),
            link,
            slot: T::default(),
            sent: 0,
            newest: None,
            ledger,
            heartbeat,
            untaken: None,
        }
    }

    /// Adds a receiver of this group to the stream of `stage`.
    pub fn attach(&mut self, stage: &str, edge: Edge<'a>) -> Result<(), LinkError> {
        if let Some(kind) = edge.accepts.filter(|kind| *kind != T::KIND) {
            return Err(LinkError::mismatch(stage, kind, Some(T::KIND)));
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
        if self.untaken.is_none() {
            self.untaken = match self.link.as_mut().map(|link| link.poll_taken(timeout)) {
                Some(polled) => match polled? {
                    Poll::Ready(missing) => Some(missing),
                    Poll::Pending => None,
                },
                None => Some(0),
            };
        }
        Ok(self.untaken.map_or(Poll::Pending, Poll::Ready))
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
            heartbeat,
            ..
        } = self;
        if let (Some(link), true) = (&mut *link, edges.is_empty()) {
            heartbeat.waiting(|| {
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
            heartbeat.waiting(|| link.send_with(&mut |place| *place = *slot))?;
        }
        heard
    }
}
