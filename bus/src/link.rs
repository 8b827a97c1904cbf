//! Links: how a stream gets from the stage that makes it to those that listen.
//!
//! Every implementation keeps the same promises, which one conformance suite checks: order is kept;
//! a hole in the sequence is counted as lost by the receiver; a receiver that comes late hears what
//! is sent from then on; a slow receiver loses the oldest under [`Keep::Newest`] and makes the sender
//! wait under [`Keep::All`]; a peer that is gone and back is heard again; the end of a stream is told.

use std::time::Duration;

use crate::sample::Sample;

/// What becomes of a sample that a receiver has no room for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Keep {
    /// The sender waits: nothing is lost.
    All,
    /// The oldest unread sample gives way, and is counted as lost.
    Newest,
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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SenderCounts {
    /// Samples sent.
    pub sent: u64,
    /// Samples that a keep-all receiver did not take within the sender's patience.
    pub undelivered: u64,
}

/// What a receiving end has counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ReceiverCounts {
    /// Samples received.
    pub received: u64,
    /// Samples known to be lost: holes in the sequence.
    pub lost: u64,
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

/// The end of a link at the stage that makes a stream.
pub trait Sender<T: Sample>: Send {
    /// Loans a slot (a default `T`), lets `write` fill it in place, numbers it and sends it.
    ///
    /// # Errors
    /// [`LinkError::Send`] if the transport fails; a slow receiver is no error.
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError>;

    /// Tells every receiver that the stream has ended.
    ///
    /// # Errors
    /// As [`Sender::send_with`].
    fn end(&mut self) -> Result<(), LinkError>;

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
}
