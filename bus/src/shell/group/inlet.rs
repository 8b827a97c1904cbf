//! A link as the input of a node.

use std::os::fd::BorrowedFd;
use std::task::Waker;
use std::time::{Duration, Instant};

use super::edge::Edge;
use super::next::Next;
use crate::link::{LinkError, MAX_DEPTH, Received};
use crate::seat::AnyReceiver;
use crate::stage::StageError;

/// Opens the receiving end of a link, once all receivers of the group are connected.
pub type Opening = Box<dyn FnOnce() -> Result<Box<dyn AnyReceiver>, LinkError> + Send>;

pub(super) struct Inlet<'a> {
    edge: Edge<'a>,
    link: Link,
    /// Interval at which the link is polled, if nothing wakes the group for its samples.
    poll_every: Option<Duration>,
    /// Largest number of samples to process after a stop request.
    left_to_take: usize,
}

enum Link {
    Closed(Opening),
    Open(Box<dyn AnyReceiver>),
    Over,
}

impl<'a> Inlet<'a> {
    pub fn new(edge: Edge<'a>, open: Opening) -> Self {
        Self {
            edge,
            link: Link::Closed(open),
            poll_every: None,
            left_to_take: MAX_DEPTH,
        }
    }

    pub fn open(&mut self) -> Result<(), LinkError> {
        self.link = match std::mem::replace(&mut self.link, Link::Over) {
            Link::Closed(open) => Link::Open(open()?),
            other => other,
        };
        Ok(())
    }

    pub fn register(&mut self, waker: &Waker) {
        if let Link::Open(receiver) = &mut self.link {
            self.poll_every = receiver.register(waker);
        }
    }

    pub fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match &self.link {
            Link::Open(receiver) => receiver.descriptor(),
            Link::Closed(_) | Link::Over => None,
        }
    }

    /// Whether samples wake the group.
    pub fn is_notified(&self) -> bool {
        self.descriptor().is_some() || self.poll_every.is_none()
    }

    pub fn is_over(&self) -> bool {
        matches!(self.link, Link::Over)
    }

    /// Processes at most `most` samples that have arrived.
    pub fn turn(&mut self, stopped: bool, most: usize) -> Result<Next, StageError> {
        let Link::Open(receiver) = &mut self.link else {
            return Ok(Next::Over);
        };
        let input = self.edge.input;
        let mut to = self.edge.to();
        for _ in 0..most {
            let mut accepted = Ok(());
            let received = receiver.receive(Duration::ZERO, &mut |sample| {
                accepted = to.accept(input, sample);
            })?;
            accepted?;
            to.count_link(input, receiver.counts(), receiver.position());
            to.tell()?;
            let over = match received {
                Received::End => true,
                Received::Nothing if stopped => true,
                Received::Nothing => {
                    return Ok(match self.poll_every {
                        Some(Duration::ZERO) => Next::Now,
                        Some(every) => Next::At(Instant::now() + every),
                        None => Next::Woken,
                    });
                }
                Received::Sample if stopped => {
                    self.left_to_take = self.left_to_take.saturating_sub(1);
                    self.left_to_take == 0
                }
                Received::Sample => false,
            };
            if over {
                self.link = Link::Over;
                to.close(input, received == Received::End)?;
                return Ok(Next::Over);
            }
        }
        Ok(Next::Now)
    }
}
