//! The receiving end over iceoryx2.

use std::os::fd::BorrowedFd;
use std::task::Waker;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::FileDescriptorBased as _;
use iceoryx2::prelude::{CallbackProgression, EventId, PortFactory as _};
use iceoryx2::service::ipc_threadsafe::Service;

use super::{
    END_TAKEN, Joined, MAX_SENDERS, Samples, SharedMemory, URGENT, greeting, open_error, wait,
};
use crate::link::sequence::Tracker;
use crate::link::{Keep, LinkError, MAX_DEPTH, Position, Received, Receiver, ReceiverCounts, Wake};
use crate::sample::Sample;

/// Interval at which a spinning receiver polls for new senders.
/// Resolution: connection delay, against the cost of polling.
const GREET_EVERY: Duration = Duration::from_millis(1);

/// Wait of a receiver, according to its [`Wake`].
enum Waiting {
    /// Wait for an event, at most for this time.
    Woken(Box<Listener<Service>>, Duration),
    /// Polling interval; zero for busy polling.
    Looks(Duration),
}

pub(super) struct SharedMemoryReceiver<T: Sample> {
    stream: String,
    subscriber: Subscriber<Service, T, Joined>,
    samples: Samples<T>,
    waiting: Waiting,
    back: Notifier<Service>,
    /// Senders whose connection this receiver has acknowledged.
    greeted: Vec<u128>,
    tracker: Tracker,
}

impl<T: Sample> SharedMemoryReceiver<T> {
    pub(super) fn open(
        transport: &SharedMemory,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Self, LinkError> {
        let events = match transport.wake {
            Wake::Event => Some(""),
            Wake::EveryMsOrUrgent(_) if T::KIND.may_alarm() => Some(URGENT),
            Wake::EveryMsOrUrgent(_) | Wake::EveryMs(_) | Wake::Spin => None,
        };
        let pause = transport.wake.pause();
        let waiting = match events {
            Some(suffix) => {
                let events = transport.events(stream, keep, suffix)?;
                let listener = events.listener_builder().create();
                let listener = listener.map_err(|error| open_error(stream, &error))?;
                Waiting::Woken(Box::new(listener), pause.unwrap_or(Duration::MAX))
            }
            None => Waiting::Looks(pause.unwrap_or_default()),
        };
        let back = transport
            .events(stream, keep, "/back")?
            .notifier_builder()
            .create()
            .map_err(|error| open_error(stream, &error))?;
        let samples = transport.samples::<T>(stream, keep)?;
        let subscriber = samples
            .subscriber_builder()
            .buffer_size(depth.clamp(1, MAX_DEPTH))
            .create()
            .map_err(|error| open_error(stream, &error))?;
        let mut receiver = Self {
            stream: stream.to_owned(),
            subscriber,
            samples,
            waiting,
            back,
            greeted: Vec::with_capacity(MAX_SENDERS),
            tracker: Tracker::of(stream),
        };
        receiver.greet()?;
        Ok(receiver)
    }

    /// Takes the next available sample and reads it in place, in the sender's segment.
    fn take(&mut self, read: &mut dyn FnMut(&T)) -> Result<Received, LinkError> {
        while let Some(sample) = self.subscriber.receive().map_err(|e| self.error(&e))? {
            let header = sample.payload().header();
            let publisher = sample.origin().value();
            let instance = (publisher >> 64) as u64 ^ publisher as u64;
            let begin = Position {
                instance,
                next: sample.user_header().since.min(header.sequence),
            };
            let taken = self
                .tracker
                .take(Some(begin), instance, sample.payload(), read);
            if taken == Some(Received::End) {
                drop(sample);
                self.tell(END_TAKEN)?;
            }
            if let Some(received) = taken {
                return Ok(received);
            }
        }
        Ok(Received::Nothing)
    }

    /// Maps the memory of new senders and acknowledges the connection to them.
    fn greet(&mut self) -> Result<(), LinkError> {
        let mut there = [None; MAX_SENDERS];
        let mut slots = there.iter_mut();
        self.samples.dynamic_config().list_publishers(|details| {
            match slots.next() {
                Some(slot) => *slot = Some(details.publisher_id.value()),
                None => return CallbackProgression::Stop,
            }
            CallbackProgression::Continue
        });
        let there = || there.iter().flatten();
        self.greeted.retain(|id| there().any(|other| other == id));
        for &id in there() {
            if !self.greeted.contains(&id) {
                // Maps the memory of new senders before it answers.
                self.has_samples()?;
                self.tell(greeting(id))?;
                self.greeted.push(id);
            }
        }
        Ok(())
    }

    fn has_samples(&self) -> Result<bool, LinkError> {
        self.subscriber.has_samples().map_err(|e| self.error(&e))
    }

    fn tell(&self, event: EventId) -> Result<(), LinkError> {
        self.back
            .notify_with_custom_event_id(event)
            .map_err(|error| self.error(&error))?;
        Ok(())
    }

    fn error(&self, error: &dyn std::fmt::Display) -> LinkError {
        LinkError::Receive {
            stream: self.stream.clone(),
            reason: error.to_string(),
        }
    }
}

impl<T: Sample> Receiver<T> for SharedMemoryReceiver<T> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError> {
        let deadline = Instant::now() + timeout;
        if let (Waiting::Woken(by, _), true) = (&self.waiting, timeout.is_zero()) {
            // An event loop waits for the descriptor, which stays readable until the events are taken. A sample that
            // is sent after this line makes it readable again.
            wait(by, timeout, |_| {}).map_err(|e| self.error(&e))?;
        }
        loop {
            let received = self.take(read)?;
            if received != Received::Nothing {
                return Ok(received);
            }
            self.greet()?;
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(Received::Nothing);
            }
            match &self.waiting {
                // A notification that arrived since the poll above ends this wait at once.
                Waiting::Woken(by, pause) => {
                    wait(by, left.min(*pause), |_| {}).map_err(|e| self.error(&e))?;
                }
                Waiting::Looks(Duration::ZERO) => {
                    let until = Instant::now() + left.min(GREET_EVERY);
                    while !self.has_samples()? && Instant::now() < until {
                        std::hint::spin_loop();
                    }
                }
                Waiting::Looks(pause) => std::thread::sleep(left.min(*pause)),
            }
        }
    }

    fn register(&mut self, _waker: &Waker) -> Option<Duration> {
        match self.waiting {
            Waiting::Woken(_, pause) => Some(pause).filter(|pause| *pause < Duration::MAX),
            Waiting::Looks(pause) => Some(pause),
        }
    }

    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        match &self.waiting {
            Waiting::Woken(by, _) => Some(descriptor(by)),
            Waiting::Looks(_) => None,
        }
    }

    fn counts(&self) -> ReceiverCounts {
        self.tracker.counts()
    }

    fn position(&self) -> Option<Position> {
        self.tracker.position()
    }

    fn resume(&mut self, position: Position) {
        self.tracker.resume(position);
    }
}

/// Descriptor that is readable while `listener` has events.
fn descriptor(listener: &Listener<Service>) -> BorrowedFd<'_> {
    // SAFETY: the handle is only read, and the listener keeps it open while it lives.
    #[allow(unsafe_code)]
    unsafe {
        BorrowedFd::borrow_raw(listener.file_descriptor().native_handle())
    }
}
