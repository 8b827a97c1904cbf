//! The sending end over iceoryx2.

use std::sync::Arc;
use std::task::Poll;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::{CallbackProgression, EventId, PortFactory as _};
use iceoryx2::service::ipc_threadsafe::Service;

use super::backpressure::Backpressure;
use super::{END_TAKEN, Joined, Samples, SharedMemory, URGENT, greeting, open_error, wait};
use crate::link::{Keep, LinkError, Sender, SenderCounts};
use crate::sample::{Sample, flags};

/// Interval of the check for crashed receivers while a receiver takes nothing.
/// Resolution: detection delay of a crashed receiver, against the cost of the check.
const CLEAN_EVERY: Duration = Duration::from_secs(1);
/// Polling interval for disconnected receivers during a wait, because a receiver disconnects without an event.
/// Resolution: detection delay of a disconnected receiver, against the cost of polling.
const LOOK_EVERY: Duration = Duration::from_millis(50);

pub(super) struct SharedMemorySender<T: Sample> {
    stream: String,
    transport: SharedMemory,
    keep: Keep,
    expected: usize,
    publisher: Publisher<Service, T, Joined>,
    samples: Samples<T>,
    wake: Notifier<Service>,
    /// Notifies receivers that wake up for urgent samples only.
    urgent: Option<Notifier<Service>>,
    back: Listener<Service>,
    greeting: EventId,
    /// Number of receivers that have acknowledged the connection.
    greeted: usize,
    /// Number of receivers that have taken the end.
    taken: usize,
    /// Number of receivers that the end was sent to.
    ended: usize,
    ended_at: Instant,
    backpressure: Arc<Backpressure>,
    /// Sum of the receivers' ids; `joined` has the sequence number of its last change.
    receivers: u128,
    joined: Joined,
    cleaned: Instant,
    next: u64,
    counts: SenderCounts,
}

impl<T: Sample> SharedMemorySender<T> {
    pub(super) fn open(
        transport: &SharedMemory,
        stream: &str,
        keep: Keep,
        expected: usize,
    ) -> Result<Self, LinkError> {
        // Opened before the publisher, so that no acknowledgement is missed.
        let back = transport
            .events(stream, keep, "/back")?
            .listener_builder()
            .create()
            .map_err(|error| open_error(stream, &error))?;
        let samples = transport.samples::<T>(stream, keep)?;
        let backpressure = Arc::new(Backpressure::new(transport.patience));
        let handler = Arc::clone(&backpressure);
        let publisher = samples
            .publisher_builder()
            .max_loaned_samples(1)
            .set_backpressure_handler(move |info| handler.decide(info))
            .create()
            .map_err(|error| open_error(stream, &error))?;
        let wake = transport
            .events(stream, keep, "")?
            .notifier_builder()
            .create()
            .map_err(|error| open_error(stream, &error))?;
        wake.notify().map_err(|error| open_error(stream, &error))?;
        let urgent = T::KIND.may_alarm().then(|| {
            (transport.events(stream, keep, URGENT)?.notifier_builder())
                .create()
                .map_err(|error| open_error(stream, &error))
        });
        Ok(Self {
            stream: stream.to_owned(),
            transport: transport.clone(),
            keep,
            expected,
            greeting: greeting(publisher.id().value()),
            publisher,
            samples,
            wake,
            urgent: urgent.transpose()?,
            back,
            greeted: 0,
            taken: 0,
            ended: 0,
            ended_at: Instant::now(),
            backpressure,
            receivers: 0,
            joined: Joined::default(),
            cleaned: Instant::now(),
            next: 0,
            counts: SenderCounts::default(),
        })
    }

    /// Sends one sample and returns the number of receivers that got it.
    fn send(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<usize, LinkError> {
        self.notice_receivers();
        let mut slot = self.publisher.loan().map_err(|e| self.error(&e))?;
        write(slot.payload_mut());
        slot.payload_mut().header_mut().sequence = self.next;
        *slot.user_header_mut() = self.joined;
        let sample = slot.payload();
        let is_urgent = sample.is_urgent() || sample.header().has(flags::END);
        self.next += 1;
        self.backpressure.begin();
        let delivered = slot.send().map_err(|e| self.error(&e))?;
        self.wake.notify().map_err(|e| self.error(&e))?;
        if let Some(urgent) = self.urgent.as_ref().filter(|_| is_urgent) {
            urgent.notify().map_err(|e| self.error(&e))?;
        }
        if self.keep == Keep::All {
            let refused = self.backpressure.refused();
            let missing = self.expected.saturating_sub(delivered).max(refused);
            self.counts.undelivered += missing as u64;
            if refused > 0 && self.cleaned.elapsed() >= CLEAN_EVERY {
                self.transport.clean_dead_peers();
                self.cleaned = Instant::now();
            }
        }
        Ok(delivered)
    }

    /// Records where the newest receiver connected. A keep-all receiver misses no sample before its buffer is full,
    /// so the first sample that it gets is the one at which it connected.
    fn notice_receivers(&mut self) {
        if self.keep == Keep::All {
            self.joined.since = self.next;
            return;
        }
        let mut sum = 0_u128;
        self.samples.dynamic_config().list_subscribers(|details| {
            sum = sum.wrapping_add(details.subscriber_id.value());
            CallbackProgression::Continue
        });
        if sum != self.receivers {
            self.receivers = sum;
            self.joined.since = self.next;
        }
    }

    /// Waits on the back channel and counts the events.
    fn listen(&mut self, timeout: Duration) -> Result<(), LinkError> {
        let (mut greeted, mut taken) = (0, 0);
        wait(&self.back, timeout, |event| {
            if event.id == self.greeting {
                greeted += event.count as usize;
            } else if event.id == END_TAKEN {
                taken += event.count as usize;
            }
        })
        .map_err(|reason| LinkError::Send {
            stream: self.stream.clone(),
            reason,
        })?;
        let there = self.samples.dynamic_config().number_of_subscribers();
        self.greeted = (self.greeted + greeted).min(there);
        self.taken += taken;
        self.ended = self.ended.min(self.taken + there);
        Ok(())
    }

    fn error(&self, error: &dyn std::fmt::Display) -> LinkError {
        LinkError::Send {
            stream: self.stream.clone(),
            reason: error.to_string(),
        }
    }
}

impl<T: Sample> Sender<T> for SharedMemorySender<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.send(write)?;
        self.counts.sent += 1;
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        self.next += count;
    }

    fn end(&mut self) -> Result<(), LinkError> {
        self.listen(Duration::ZERO)?;
        self.taken = 0;
        self.ended = self.send(&mut |sample| sample.header_mut().flags = flags::END)?;
        self.ended_at = Instant::now();
        Ok(())
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let deadline = Instant::now() + timeout;
        loop {
            self.publisher
                .update_connections()
                .map_err(|e| self.error(&e))?;
            let left = deadline.saturating_duration_since(Instant::now());
            self.listen(left.min(LOOK_EVERY))?;
            let missing = self.expected.saturating_sub(self.greeted);
            if missing == 0 || left.is_zero() {
                return Ok(missing);
            }
        }
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        if self.ended > self.taken {
            self.listen(Duration::ZERO)?;
        }
        let missing = self.ended.saturating_sub(self.taken);
        Ok(if missing == 0 || self.ended_at.elapsed() >= timeout {
            Poll::Ready(missing)
        } else {
            Poll::Pending
        })
    }

    fn counts(&self) -> SenderCounts {
        self.counts
    }
}
