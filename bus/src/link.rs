//! Links: the transport of a stream from the stage that emits it to its receivers.
//!
//! Every implementation gives the same guarantees, which one conformance suite checks:
//!
//! - Samples arrive in order, and the receiver counts a gap in the sequence as lost.
//! - A receiver that connects late gets all samples sent from then on.
//! - A slow receiver loses the oldest samples under [`Keep::Newest`] and blocks the sender under [`Keep::All`].
//! - After a restart of either peer the stream continues.
//! - The end of the stream is delivered to every receiver.

use std::os::fd::BorrowedFd;
use std::task::{Poll, Waker};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::sample::{Sample, SampleKind};

mod fan_out;
mod in_process;
mod queue;
mod sequence;
mod shared_memory;
mod spill;
mod wake;
pub mod wire;
pub mod zenoh;

pub use fan_out::FanOut;
pub use in_process::InProcess;
pub use shared_memory::{
    Domain, DomainError, MAX_RECEIVERS, SharedMemory, left_behind, remove_left_behind,
};
pub use spill::{Spill, SpillSettings};
pub use wake::Wake;
pub use zenoh::{Zenoh, ZenohEndpoints, ZenohRouter, zenoh_reason};

/// Stall timeout: longest wait for a keep-all receiver that takes nothing. Then the sample counts as undelivered, and
/// the sender does not wait for this receiver again until it has taken a sample.
/// Chosen: a busy disk or scheduler stops a receiver for a second or two; a longer wait only holds up all other
/// receivers.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Interval at which a sender is asked whether its stream has been taken.
/// Resolution: delay of the end of a stage.
pub(crate) const POLL_TAKEN_EVERY: Duration = Duration::from_millis(1);

/// Largest number of unread samples of a receiver.
/// Resolution: memory.
pub const MAX_DEPTH: usize = 1024;

/// Overflow policy of a receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// The sender waits; nothing is lost.
    #[default]
    All,
    /// The oldest unread sample is discarded and counted as lost.
    Newest,
}

/// Number of receivers that a sender expects, by overflow policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Audience {
    /// Receivers with [`Keep::All`].
    pub keep_all: usize,
    /// Receivers with [`Keep::Newest`].
    pub keep_newest: usize,
}

impl Audience {
    /// `count` receivers with one policy.
    pub fn of(keep: Keep, count: usize) -> Self {
        match keep {
            Keep::All => Self {
                keep_all: count,
                keep_newest: 0,
            },
            Keep::Newest => Self {
                keep_all: 0,
                keep_newest: count,
            },
        }
    }

    /// Number of receivers with this policy.
    pub fn count(&self, keep: Keep) -> usize {
        match keep {
            Keep::All => self.keep_all,
            Keep::Newest => self.keep_newest,
        }
    }
}

/// Position of a receiver in a stream.
///
/// A sender that restarts counts from 0 again under another `instance`, so that a restart neither looks like a large
/// gap nor hides one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// Session epoch of the sender.
    pub instance: u64,
    /// Sequence number expected next.
    pub next: u64,
}

/// Failure of a link.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// Link that could not be opened.
    #[error("cannot open the link for stream `{stream}` over {transport}: {reason}")]
    Open {
        /// Name of the stream.
        stream: String,
        /// `in process`, `iceoryx2` or `zenoh`.
        transport: &'static str,
        /// Error message of the transport.
        reason: String,
    },
    /// Zenoh session that could not be opened.
    #[error("cannot open a Zenoh session at {at}: {reason}")]
    Session {
        /// Endpoints to listen on and to connect to.
        at: String,
        /// Cause, and what to do.
        reason: String,
    },
    /// Sample that could not be sent.
    #[error("cannot send on stream `{stream}`: {reason}")]
    Send {
        /// Name of the stream.
        stream: String,
        /// Error message of the transport.
        reason: String,
    },
    /// Failure of the transport while receiving.
    #[error("cannot receive from stream `{stream}`: {reason}")]
    Receive {
        /// Name of the stream.
        stream: String,
        /// Error message of the transport.
        reason: String,
    },
    /// Peer with another type, or another version of the sample type.
    #[error("stream `{stream}` carries {found}, expected {expected}")]
    TypeMismatch {
        /// Name of the stream.
        stream: String,
        /// Expected type.
        expected: String,
        /// Type of the peer.
        found: String,
    },
}

impl LinkError {
    /// A stream of another type than expected; `found` is `None` if there is no stream.
    pub(crate) fn mismatch(stream: &str, expected: SampleKind, found: Option<SampleKind>) -> Self {
        let name = |kind: SampleKind| kind.type_name().to_owned();
        Self::TypeMismatch {
            stream: stream.to_owned(),
            expected: name(expected),
            found: found.map_or_else(|| "no stream".to_owned(), name),
        }
    }
}

/// Counters of a sending end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SenderCounts {
    /// Samples sent.
    pub sent: u64,
    /// Samples that an expected keep-all receiver did not get, once per such receiver: it was not connected, or it
    /// took nothing within the stall timeout.
    pub undelivered: u64,
}

/// Counters of a receiving end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ReceiverCounts {
    /// Samples received.
    pub received: u64,
    /// Samples known to be lost: gaps in the sequence.
    pub lost: u64,
    /// Invalid samples, which no stage gets ([`Sample::check`]).
    #[serde(default)]
    pub refused: u64,
    /// Samples sent before this end connected.
    #[serde(default)]
    pub before: u64,
    /// Messages that are not samples of this stream or not from its sender; not part of the balance of samples.
    #[serde(default)]
    pub foreign: u64,
    /// Sessions of the sender that ended without an end of the stream and without a successor that accounts for them;
    /// the number of samples that they sent is unknown.
    #[serde(default)]
    pub broken_off: u64,
}

impl ReceiverCounts {
    /// Samples of the stream that were not received; with `received`, these are all samples of the stream.
    pub fn dropped(&self) -> u64 {
        let lost = self.lost.saturating_add(self.refused);
        lost.saturating_add(self.before)
    }
}

/// Result of [`Receiver::receive`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// A sample, passed to the reader in place.
    Sample,
    /// No sample within the timeout.
    Nothing,
    /// Normal end of the stream. Samples of a restarted sender are received again.
    End,
}

/// A transport of streams.
pub trait Transport {
    /// Opens the sending end of `stream`. A stream has one sender at a time.
    ///
    /// # Errors
    /// [`LinkError::Open`], or [`LinkError::TypeMismatch`] if the stream is already open with
    /// another type.
    fn sender<T: Sample>(
        &self,
        stream: &str,
        audience: Audience,
    ) -> Result<Box<dyn Sender<T>>, LinkError>;

    /// Opens a receiving end of `stream` that leaves at most `depth` samples unread (clamped to 1 to [`MAX_DEPTH`]).
    ///
    /// # Errors
    /// See [`Transport::sender`].
    fn receiver<T: Sample>(
        &self,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Box<dyn Receiver<T>>, LinkError>;
}

/// Sending end of a link, at the stage that emits the stream.
pub trait Sender<T: Sample>: Send {
    /// Loans a slot (a default `T`), lets `write` fill it in place, numbers it and sends it.
    ///
    /// # Errors
    /// [`LinkError::Send`] if the transport fails; a slow receiver is not an error.
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError>;

    /// Advances the sequence by `count` samples lost before they could be sent; the receivers find a gap.
    fn skip(&mut self, count: u64);

    /// Sends the end of the stream to every receiver.
    ///
    /// # Errors
    /// See [`Sender::send_with`].
    fn end(&mut self) -> Result<(), LinkError>;

    /// Waits until the expected receivers are connected and returns the number of missing ones.
    ///
    /// # Errors
    /// [`LinkError::Send`] if the transport fails.
    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError>;

    /// Ready after [`Sender::end`] once every connected receiver has taken the end and so all samples before it, or
    /// when the wait is over. Returns the number of receivers that have not. A process that exits earlier may lose
    /// unread samples.
    /// It is not called again once it is ready.
    ///
    /// The wait ends `timeout` after the end or after the last progress that the transport knows of, whichever is
    /// later, as the user timeout of TCP (RFC 5482): a slow receiver is no reason to give up.
    ///
    /// # Errors
    /// See [`Sender::send_with`].
    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError>;

    /// Waits until [`Sender::poll_taken`] is ready.
    ///
    /// # Errors
    /// See [`Sender::send_with`].
    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        loop {
            if let Poll::Ready(missing) = self.poll_taken(timeout)? {
                return Ok(missing);
            }
            std::thread::sleep(POLL_TAKEN_EVERY);
        }
    }

    /// The counters.
    fn counts(&self) -> SenderCounts;
}

/// Receiving end of a link, at a stage that accepts the stream.
pub trait Receiver<T: Sample>: Send {
    /// Waits at most `timeout` for the next sample and passes it to `read` in place.
    ///
    /// # Errors
    /// [`LinkError::Receive`] or [`LinkError::TypeMismatch`].
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError>;

    /// Announces new samples to an event loop, which then calls [`Receiver::receive`] without a timeout: wakes
    /// `waker`, unless there is a [`Receiver::descriptor`] or the result is an interval at which the receiver is to be
    /// polled; zero for busy polling.
    fn register(&mut self, waker: &Waker) -> Option<Duration>;

    /// Descriptor that is readable when there are samples.
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    /// The counters.
    fn counts(&self) -> ReceiverCounts;

    /// Position in the stream; `None` before the first message.
    fn position(&self) -> Option<Position>;

    /// Resumes at the position of an earlier incarnation of this receiver. Samples sent since then that no longer
    /// arrive count as lost.
    fn resume(&mut self, position: Position);
}

impl<T: Sample, S: Sender<T> + ?Sized> Sender<T> for Box<S> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        (**self).send_with(write)
    }
    fn skip(&mut self, count: u64) {
        (**self).skip(count);
    }
    fn end(&mut self) -> Result<(), LinkError> {
        (**self).end()
    }
    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        (**self).wait_for_receivers(timeout)
    }
    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        (**self).poll_taken(timeout)
    }
    fn counts(&self) -> SenderCounts {
        (**self).counts()
    }
}

impl<T: Sample, S: Sender<T> + ?Sized> Sender<T> for &mut S {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        (**self).send_with(write)
    }
    fn skip(&mut self, count: u64) {
        (**self).skip(count);
    }
    fn end(&mut self) -> Result<(), LinkError> {
        (**self).end()
    }
    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        (**self).wait_for_receivers(timeout)
    }
    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        (**self).poll_taken(timeout)
    }
    fn counts(&self) -> SenderCounts {
        (**self).counts()
    }
}

impl<T: Sample, R: Receiver<T> + ?Sized> Receiver<T> for &mut R {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError> {
        (**self).receive(timeout, read)
    }
    fn register(&mut self, waker: &Waker) -> Option<Duration> {
        (**self).register(waker)
    }
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        (**self).descriptor()
    }
    fn counts(&self) -> ReceiverCounts {
        (**self).counts()
    }
    fn position(&self) -> Option<Position> {
        (**self).position()
    }
    fn resume(&mut self, position: Position) {
        (**self).resume(position);
    }
}
