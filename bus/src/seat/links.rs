//! Opens the links of a seat.

use std::any::Any;
use std::os::fd::BorrowedFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Waker;
use std::time::Duration;

use super::{Input, Output, OutputLink, Seat, TransportKind};
use crate::link::{
    Audience, Domain, FanOut, Keep, LinkError, Position, Received, Receiver, ReceiverCounts,
    Sender, SharedMemory, Spill, Transport as _, Zenoh, ZenohEndpoints,
};
use crate::sample::{Detection, Health, JointState, Sample, SampleKind, SampleRef, TwinState};

/// Stall timeout of a sender behind a queue, for a receiver that is alive and takes nothing.
/// Chosen: longer than any queue lasts, so that the queue's limits decide what becomes of a stalled receiver.
const SPILLED_PATIENCE: Duration = Duration::from_mins(10);

/// The transports of a process, opened on first use. Clones share them.
#[derive(Debug, Clone, Default)]
pub struct Transports(Arc<Mutex<Open>>);

#[derive(Debug, Default)]
struct Open {
    shared_memory: Option<SharedMemory>,
    zenoh: Option<Zenoh>,
}

/// The links of a seat.
#[derive(Debug)]
pub struct Links {
    transports: Transports,
    domain: Domain,
    receivers: usize,
    zenoh: Option<ZenohEndpoints>,
    patience: Duration,
}

impl Links {
    /// Links of a seat in the process with these transports. All seats of a process share one domain and the same
    /// endpoints.
    pub fn of(seat: &Seat, transports: &Transports) -> Self {
        Self {
            transports: transports.clone(),
            domain: seat.domain.clone(),
            receivers: seat.receivers,
            zenoh: seat.zenoh.clone(),
            patience: seat.patience(),
        }
    }

    /// Opens the sending end of `output` over all its links.
    ///
    /// # Errors
    /// See [`Transport::sender`](crate::Transport::sender).
    pub fn sender<T: Sample>(&self, output: &Output) -> Result<Box<dyn Sender<T>>, LinkError> {
        check::<T>(&output.stream, output.kind)?;
        let mut ways = Vec::new();
        for link in &output.links {
            self.way(output, link, &mut ways)?;
        }
        match ways.len() {
            1 => Ok(ways.remove(0)),
            _ => Ok(Box::new(FanOut::new(ways))),
        }
    }

    fn way<T: Sample>(
        &self,
        output: &Output,
        link: &OutputLink,
        ways: &mut Vec<Box<dyn Sender<T>>>,
    ) -> Result<(), LinkError> {
        let stream = output.stream.as_str();
        let OutputLink {
            transport,
            audience,
            spill,
        } = *link;
        match (transport, spill) {
            (TransportKind::InProcess, _) => return Err(in_process(stream)),
            (TransportKind::Iceoryx2, None) => {
                ways.push(self.shared_memory()?.sender(stream, audience)?);
            }
            (TransportKind::Iceoryx2, Some(spill)) => {
                let shared_memory = self.shared_memory()?;
                let newest = Audience::of(Keep::Newest, audience.keep_newest);
                if audience.keep_newest > 0 {
                    ways.push(shared_memory.sender(stream, newest)?);
                }
                if audience.keep_all > 0 {
                    let patient = shared_memory.with_patience(SPILLED_PATIENCE);
                    let inner =
                        patient.sender(stream, Audience::of(Keep::All, audience.keep_all))?;
                    let spill = Spill::new(inner, spill, self.patience, audience.keep_all);
                    ways.push(Box::new(spill));
                }
            }
            (TransportKind::Zenoh, spill) => {
                let zenoh = self.zenoh()?.with_former(output.former);
                let zenoh = match spill {
                    Some(spill) => zenoh.with_spill(spill),
                    None => zenoh,
                };
                ways.push(zenoh.sender(stream, audience)?);
            }
        }
        Ok(())
    }

    /// Opens the sending end of an `output` whose sample type is known at run time only; `None` without links.
    ///
    /// # Errors
    /// See [`Links::sender`].
    pub fn any_sender(&self, output: &Output) -> Result<Option<AnySender>, LinkError> {
        if output.links.is_empty() {
            return Ok(None);
        }
        Ok(Some(match output.kind {
            SampleKind::JointState => AnySender::new(self.sender::<JointState>(output)?),
            SampleKind::TwinState => AnySender::new(self.sender::<TwinState>(output)?),
            SampleKind::Detection => AnySender::new(self.sender::<Detection>(output)?),
            SampleKind::Health => AnySender::new(self.sender::<Health>(output)?),
        }))
    }

    /// Opens the receiving end of `input`.
    ///
    /// # Errors
    /// See [`Transport::receiver`](crate::Transport::receiver).
    pub fn receiver<T: Sample>(&self, input: &Input) -> Result<Box<dyn Receiver<T>>, LinkError> {
        check::<T>(&input.stream, input.kind)?;
        let (stream, keep, depth) = (&input.stream, input.keep, input.depth);
        let mut receiver = match input.transport {
            TransportKind::InProcess => return Err(in_process(stream)),
            TransportKind::Iceoryx2 => {
                let shared_memory = self.shared_memory()?.with_wake(input.wake);
                shared_memory.receiver::<T>(stream, keep, depth)?
            }
            TransportKind::Zenoh => self.zenoh()?.receiver::<T>(stream, keep, depth)?,
        };
        if let Some(position) = input.resume {
            receiver.resume(position);
        }
        Ok(receiver)
    }

    /// Opens the receiving end of an `input` whose sample type is known at run time only.
    ///
    /// # Errors
    /// See [`Links::receiver`].
    pub fn any_receiver(&self, input: &Input) -> Result<Box<dyn AnyReceiver>, LinkError> {
        Ok(match input.kind {
            SampleKind::JointState => Box::new(self.receiver::<JointState>(input)?),
            SampleKind::TwinState => Box::new(self.receiver::<TwinState>(input)?),
            SampleKind::Detection => Box::new(self.receiver::<Detection>(input)?),
            SampleKind::Health => Box::new(self.receiver::<Health>(input)?),
        })
    }

    fn shared_memory(&self) -> Result<SharedMemory, LinkError> {
        let mut open = self.transports.lock();
        let shared = match &open.shared_memory {
            Some(shared) => shared.clone(),
            None => open
                .shared_memory
                .insert(SharedMemory::open(&self.domain)?)
                .clone(),
        };
        let shared = shared.with_receivers(self.receivers);
        Ok(shared.with_patience(self.patience))
    }

    fn zenoh(&self) -> Result<Zenoh, LinkError> {
        let mut open = self.transports.lock();
        if let Some(zenoh) = &open.zenoh {
            return Ok(zenoh.clone());
        }
        let endpoints = self.zenoh.clone().unwrap_or_default();
        let zenoh = Zenoh::open(&endpoints, self.patience)?;
        Ok(open.zenoh.insert(zenoh).clone())
    }
}

impl Transports {
    // No code panics while it holds the lock.
    fn lock(&self) -> MutexGuard<'_, Open> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A sending end whose sample type is known at run time only.
pub struct AnySender {
    kind: SampleKind,
    /// A `Box<dyn Sender<T>>` of the type that `kind` names.
    sender: Box<dyn Any + Send>,
}

impl AnySender {
    /// Erases the type of `sender`.
    pub fn new<T: Sample>(sender: Box<dyn Sender<T>>) -> Self {
        Self {
            kind: T::KIND,
            sender: Box::new(sender),
        }
    }

    /// Returns the sender of the stream of `stage`, whose samples are of type `T`.
    pub(crate) fn typed<T: Sample>(self, stage: &str) -> Result<Box<dyn Sender<T>>, LinkError> {
        let kind = self.kind;
        check::<T>(stage, kind)?;
        let sender = self.sender.downcast::<Box<dyn Sender<T>>>();
        // The kinds are equal, so the types are.
        sender.map(|sender| *sender).map_err(|_| LinkError::Open {
            stream: stage.to_owned(),
            transport: "in process",
            reason: format!("its sender is not one of {}", kind.type_name()),
        })
    }
}

/// A receiving end whose sample type is known at run time only.
pub trait AnyReceiver: Send {
    /// See [`Receiver::receive`].
    ///
    /// # Errors
    /// See [`Receiver::receive`].
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(SampleRef<'_>),
    ) -> Result<Received, LinkError>;

    /// See [`Receiver::register`].
    fn register(&mut self, waker: &Waker) -> Option<Duration>;

    /// See [`Receiver::descriptor`].
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// See [`Receiver::counts`].
    fn counts(&self) -> ReceiverCounts;

    /// See [`Receiver::position`].
    fn position(&self) -> Option<Position>;
}

impl<T: Sample> AnyReceiver for Box<dyn Receiver<T> + '_> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(SampleRef<'_>),
    ) -> Result<Received, LinkError> {
        (**self).receive(timeout, &mut |sample| read(sample.as_ref()))
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
}

fn check<T: Sample>(stream: &str, kind: SampleKind) -> Result<(), LinkError> {
    if kind == T::KIND {
        return Ok(());
    }
    Err(LinkError::mismatch(stream, T::KIND, Some(kind)))
}

fn in_process(stream: &str) -> LinkError {
    LinkError::Open {
        stream: stream.to_owned(),
        transport: "in process",
        reason: "its two stages are not in one group".to_owned(),
    }
}
