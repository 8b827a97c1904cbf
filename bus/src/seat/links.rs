//! The links of a seat, opened.

use std::time::Duration;

use super::{Input, Output, Seat, TransportKind};
use crate::link::{
    FanOut, LinkError, Position, Received, Receiver, ReceiverCounts, Sender, SharedMemory,
    Transport as _, Zenoh,
};
use crate::sample::{Detection, Health, JointState, Sample, SampleKind, SampleRef, TwinState};

/// The transports that a seat's links need.
#[derive(Debug)]
pub struct Links {
    shared_memory: Option<SharedMemory>,
    zenoh: Option<Zenoh>,
}

impl Links {
    /// Opens the transports.
    ///
    /// # Errors
    /// If one cannot be opened.
    pub fn open(seat: &Seat) -> Result<Self, LinkError> {
        let uses = |kind| {
            let outputs = seat.output.iter().chain(&seat.health);
            seat.inputs.iter().any(|input| input.transport == kind)
                || outputs
                    .flat_map(|output| &output.links)
                    .any(|link| link.transport == kind)
        };
        let shared_memory = if uses(TransportKind::Iceoryx2) {
            Some(SharedMemory::open(&seat.domain)?.with_patience(seat.patience()))
        } else {
            None
        };
        let zenoh = if uses(TransportKind::Zenoh) {
            let endpoints = seat.zenoh.clone().unwrap_or_default();
            Some(Zenoh::open(&endpoints, seat.patience())?)
        } else {
            None
        };
        Ok(Self {
            shared_memory,
            zenoh,
        })
    }

    /// Opens the sending end of `output` on all its ways.
    ///
    /// # Errors
    /// As [`Transport::sender`](crate::Transport::sender).
    pub fn sender<T: Sample>(&self, output: &Output) -> Result<Box<dyn Sender<T>>, LinkError> {
        check::<T>(&output.stream, output.kind)?;
        let mut ways = Vec::new();
        for link in &output.links {
            ways.push(match link.transport {
                TransportKind::Iceoryx2 => self
                    .shared_memory(&output.stream)?
                    .sender::<T>(&output.stream, link.audience)?,
                TransportKind::Zenoh => self
                    .zenoh(&output.stream)?
                    .sender::<T>(&output.stream, link.audience)?,
            });
        }
        match ways.len() {
            1 => Ok(ways.remove(0)),
            _ => Ok(Box::new(FanOut::new(ways))),
        }
    }

    /// Opens the receiving end of `input`.
    ///
    /// # Errors
    /// As [`Transport::receiver`](crate::Transport::receiver).
    pub fn receiver<T: Sample>(&self, input: &Input) -> Result<Box<dyn Receiver<T>>, LinkError> {
        check::<T>(&input.stream, input.kind)?;
        let mut receiver = match input.transport {
            TransportKind::Iceoryx2 => self.shared_memory(&input.stream)?.receiver::<T>(
                &input.stream,
                input.keep,
                input.depth,
            )?,
            TransportKind::Zenoh => {
                self.zenoh(&input.stream)?
                    .receiver::<T>(&input.stream, input.keep, input.depth)?
            }
        };
        if let Some(position) = input.resume {
            receiver.resume(position);
        }
        Ok(receiver)
    }

    /// The same where the type is known at run time only.
    ///
    /// # Errors
    /// As [`Links::receiver`].
    pub fn any_receiver(&self, input: &Input) -> Result<Box<dyn AnyReceiver>, LinkError> {
        Ok(match input.kind {
            SampleKind::JointState => Box::new(self.receiver::<JointState>(input)?),
            SampleKind::TwinState => Box::new(self.receiver::<TwinState>(input)?),
            SampleKind::Detection => Box::new(self.receiver::<Detection>(input)?),
            SampleKind::Health => Box::new(self.receiver::<Health>(input)?),
        })
    }

    fn shared_memory(&self, stream: &str) -> Result<&SharedMemory, LinkError> {
        self.shared_memory
            .as_ref()
            .ok_or_else(|| not_open(stream, "iceoryx2"))
    }

    fn zenoh(&self, stream: &str) -> Result<&Zenoh, LinkError> {
        self.zenoh.as_ref().ok_or_else(|| not_open(stream, "zenoh"))
    }
}

/// A receiving end whose sample type is known at run time only.
pub trait AnyReceiver: Send {
    /// As [`Receiver::receive`].
    ///
    /// # Errors
    /// As [`Receiver::receive`].
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(SampleRef<'_>),
    ) -> Result<Received, LinkError>;

    /// As [`Receiver::counts`].
    fn counts(&self) -> ReceiverCounts;

    /// As [`Receiver::position`].
    fn position(&self) -> Option<Position>;
}

impl<T: Sample> AnyReceiver for Box<dyn Receiver<T>> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(SampleRef<'_>),
    ) -> Result<Received, LinkError> {
        (**self).receive(timeout, &mut |sample| read(sample.as_ref()))
    }

    fn counts(&self) -> ReceiverCounts {
        (**self).counts()
    }

    fn position(&self) -> Option<Position> {
        (**self).position()
    }
}

fn check<T: Sample>(stream: &str, kind: SampleKind) -> Result<(), LinkError> {
    if kind == T::KIND {
        return Ok(());
    }
    Err(LinkError::TypeMismatch {
        stream: stream.to_owned(),
        expected: T::KIND.type_name().to_owned(),
        found: kind.type_name().to_owned(),
    })
}

fn not_open(stream: &str, transport: &'static str) -> LinkError {
    LinkError::Open {
        stream: stream.to_owned(),
        transport,
        reason: "the seat was opened without it".to_owned(),
    }
}
