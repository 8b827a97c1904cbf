//! Links: how a stream gets from the stage that makes it to those that listen.
//!
//! Every implementation keeps the same promises, which one conformance suite checks: order is kept;
//! a hole in the sequence is counted as lost by the receiver; a receiver that comes late hears what
//! is sent from then on; a slow receiver loses the oldest under [`Keep::Newest`] and makes the sender
//! wait under [`Keep::All`]; a peer that is gone and back is heard again; the end of a stream is told.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::sample::Sample;

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

/// How long a sender waits for one keep-all receiver that takes nothing, before it counts the
/// sample as undelivered and goes on. A receiver that has used this up is not waited for again until
/// it has taken something.
/// Tuned: by hand, on no recorded seeds; not swept.
pub const PATIENCE: Duration = Duration::from_secs(5);

/// Most samples that a keep-all receiver may leave unread.
/// Resolution: memory.
pub const MAX_DEPTH: usize = 1024;

/// What becomes of a sample that a receiver has no room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Keep {
    /// The sender waits: nothing is lost.
    #[default]
    All,
    /// The oldest unread sample gives way, and is counted as lost.
    Newest,
}

/// How many receivers of each kind a sender expects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Audience {
    /// Receivers that keep all.
    pub keep_all: usize,
    /// Receivers that keep the newest.
    pub keep_newest: usize,
}

impl Audience {
    /// `count` receivers of one kind.
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

    /// How many expect this policy.
    pub fn count(&self, keep: Keep) -> usize {
        match keep {
            Keep::All => self.keep_all,
            Keep::Newest => self.keep_newest,
        }
    }
}

/// How far a receiver has come in a stream.
///
/// A sender that starts anew counts from 0 again under another `instance`, so that its restart is
/// neither taken for a giant gap nor hides one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    /// Which life of the sender.
    pub instance: u64,
    /// The sequence number expected next.
    pub next: u64,
}

/// Why a link cannot do what was asked.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// It could not be opened.
    #[error("cannot open the link for stream `{stream}` over {transport}: {reason}")]
    Open {
        /// The stream.
        stream: String,
        /// `in process`, `iceoryx2` or `zenoh`.
        transport: &'static str,
        /// What the transport says.
        reason: String,
    },
    /// There is no session with those that are reached over a network.
    #[error("cannot open a Zenoh session at {at}: {reason}")]
    Session {
        /// Where it listens and connects.
        at: String,
        /// Why, and what to do.
        reason: String,
    },
    /// A sample could not be sent.
    #[error("cannot send on stream `{stream}`: {reason}")]
    Send {
        /// The stream.
        stream: String,
        /// What the transport says.
        reason: String,
    },
    /// Receiving failed.
    #[error("cannot receive from stream `{stream}`: {reason}")]
    Receive {
        /// The stream.
        stream: String,
        /// What the transport says.
        reason: String,
    },
    /// The other side speaks another version of the sample type.
    #[error("stream `{stream}` carries {found}, expected {expected}")]
    TypeMismatch {
        /// The stream.
        stream: String,
        /// The type that was expected.
        expected: String,
        /// The type that came.
        found: String,
    },
}

/// What a sending end has counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SenderCounts {
    /// Samples sent.
    pub sent: u64,
    /// Samples that an expected keep-all receiver did not get, once per such receiver: it was not
    /// there, or it took nothing within the sender's patience.
    pub undelivered: u64,
}

/// What a receiving end has counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ReceiverCounts {
    /// Samples received.
    pub received: u64,
    /// Samples known to be lost: holes in the sequence.
    pub lost: u64,
    /// Samples that no stage may see ([`Sample::check`]).
    #[serde(default)]
    pub refused: u64,
    /// Samples sent before this end came in.
    #[serde(default)]
    pub before: u64,
    /// Messages of somebody who is not the stream's sender, or that are no samples of it: not part of the books.
    #[serde(default)]
    pub foreign: u64,
    /// Lives of the sender that ended without an end of the stream, and of which no later life knows: nobody knows how
    /// many samples they had sent.
    #[serde(default)]
    pub broken_off: u64,
}

impl ReceiverCounts {
    /// Samples of the stream that did not get through; the stream has these and those received.
    pub fn dropped(&self) -> u64 {
        let lost = self.lost.saturating_add(self.refused);
        lost.saturating_add(self.before)
    }
}

/// What a receiving end got.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// A sample, which was handed to the reader in place.
    Sample,
    /// Nothing within the time.
    Nothing,
    /// The stream has ended in order. What a sender that starts anew sends is heard again.
    End,
}

/// One way of carrying streams.
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

    /// Opens a receiving end of `stream` that leaves at most `depth` samples unread (1 to
    /// [`MAX_DEPTH`]; what is outside is brought inside).
    ///
    /// # Errors
    /// As [`Transport::sender`].
    fn receiver<T: Sample>(
        &self,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Box<dyn Receiver<T>>, LinkError>;
}

/// The end of a link at the stage that makes a stream.
pub trait Sender<T: Sample>: Send {
    /// Loans a slot (a default `T`), lets `write` fill it in place, numbers it and sends it.
    ///
    /// # Errors
    /// [`LinkError::Send`] if the transport fails; a slow receiver is no error.
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError>;

    /// So many samples are lost before they could be sent: the receivers find a hole in the sequence.
    fn skip(&mut self, count: u64);

    /// Tells every receiver that the stream has ended.
    ///
    /// # Errors
    /// As [`Sender::send_with`].
    fn end(&mut self) -> Result<(), LinkError>;

    /// Waits until the expected receivers are connected and returns how many are missing.
    ///
    /// # Errors
    /// [`LinkError::Send`] if the transport fails.
    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError>;

    /// After [`Sender::end`]: waits until every receiver that was told has taken the end (and with
    /// it all that came before), and returns how many have not. A process that exits earlier may
    /// take unread samples with it.
    ///
    /// # Errors
    /// As [`Sender::send_with`].
    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError>;

    /// What it has counted.
    fn counts(&self) -> SenderCounts;
}

/// The end of a link at a stage that listens.
pub trait Receiver<T: Sample>: Send {
    /// Waits at most `timeout` for the next sample and hands it to `read` where it lies.
    ///
    /// # Errors
    /// [`LinkError::Receive`] or [`LinkError::TypeMismatch`].
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError>;

    /// What it has counted.
    fn counts(&self) -> ReceiverCounts;

    /// How far it has come; `None` if it has heard nothing yet.
    fn position(&self) -> Option<Position>;

    /// Goes on where an earlier life of this receiver was: what was sent since then and is not heard
    /// any more counts as lost.
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
    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        (**self).wait_until_taken(timeout)
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
    fn wait_until_taken(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        (**self).wait_until_taken(timeout)
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
