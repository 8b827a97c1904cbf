//! One stream over several links.

use std::task::Poll;
use std::time::{Duration, Instant};

use super::{LinkError, Sender, SenderCounts};
use crate::sample::Sample;

/// Sends every sample on all of its links: written in place on the first, copied to the others.
/// Without links, samples are written and discarded.
pub struct FanOut<T> {
    links: Vec<Box<dyn Sender<T>>>,
    /// Receivers by link that have not taken the end, once that is known: a link that has given up counts once.
    untaken: Vec<Option<usize>>,
    sent: u64,
}

impl<T: Sample> FanOut<T> {
    /// A sender over all of `links`.
    pub fn new(links: Vec<Box<dyn Sender<T>>>) -> Self {
        Self {
            untaken: vec![None; links.len()],
            links,
            sent: 0,
        }
    }
}

impl<T: Sample> Sender<T> for FanOut<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.sent += 1;
        match self.links.as_mut_slice() {
            [] => write(&mut T::default()),
            [only] => only.send_with(write)?,
            [first, others @ ..] => {
                let mut copy = T::default();
                first.send_with(&mut |slot| {
                    write(slot);
                    copy = *slot;
                })?;
                for link in others {
                    link.send_with(&mut |slot| *slot = copy)?;
                }
            }
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        for link in &mut self.links {
            link.skip(count);
        }
    }

    fn end(&mut self) -> Result<(), LinkError> {
        self.links.iter_mut().try_for_each(Sender::end)
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let deadline = Instant::now() + timeout;
        self.links.iter_mut().try_fold(0, |missing, link| {
            let left = deadline.saturating_duration_since(Instant::now());
            Ok(missing + link.wait_for_receivers(left)?)
        })
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        for (link, untaken) in self.links.iter_mut().zip(&mut self.untaken) {
            if untaken.is_none()
                && let Poll::Ready(missing) = link.poll_taken(timeout)?
            {
                *untaken = Some(missing);
            }
        }
        let all: Option<usize> = self.untaken.iter().copied().sum();
        Ok(all.map_or(Poll::Pending, Poll::Ready))
    }

    fn counts(&self) -> SenderCounts {
        SenderCounts {
            sent: self.sent,
            undelivered: self
                .links
                .iter()
                .map(|link| link.counts().undelivered)
                .sum(),
        }
    }
}
