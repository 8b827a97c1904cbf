//! Links within one process, without copies: the reader gets the slot that the writer filled.

use std::any::Any;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::{Poll, Waker};
use std::time::{Duration, Instant};

use super::queue::{Message, Pushed, Queue};
use super::sequence::Tracker;
use super::{
    Audience, Keep, LinkError, MAX_DEPTH, PATIENCE, Position, Received, Receiver, ReceiverCounts,
    Sender, SenderCounts, Transport,
};
use crate::sample::{Sample, SampleKind, flags};

/// Streams between the threads of one process. Clones share the streams.
#[derive(Debug, Clone)]
pub struct InProcess {
    streams: Arc<Mutex<HashMap<String, Stream>>>,
    patience: Duration,
}

impl Default for InProcess {
    fn default() -> Self {
        Self {
            streams: Arc::default(),
            patience: PATIENCE,
        }
    }
}

/// State shared by all ends of a stream. `channel` is an `Arc<Channel<T>>` of the type that `kind` names.
#[derive(Debug)]
struct Stream {
    kind: SampleKind,
    channel: Box<dyn Any + Send>,
}

#[derive(Debug)]
struct Channel<T> {
    readers: Mutex<Readers<T>>,
    joined: Condvar,
}

type Readers<T> = Vec<Arc<Queue<Arc<T>>>>;

impl InProcess {
    /// A transport without streams.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets the stall timeout, by default [`PATIENCE`].
    #[must_use]
    pub fn with_patience(mut self, patience: Duration) -> Self {
        self.patience = patience;
        self
    }

    fn channel<T: Sample>(&self, stream: &str) -> Result<Arc<Channel<T>>, LinkError> {
        let mut streams = lock(&self.streams);
        let entry = streams.entry(stream.to_owned()).or_insert_with(|| Stream {
            kind: T::KIND,
            channel: Box::new(Arc::new(Channel::<T>::new())),
        });
        entry
            .channel
            .downcast_ref::<Arc<Channel<T>>>()
            .cloned()
            .ok_or_else(|| LinkError::TypeMismatch {
                stream: stream.to_owned(),
                expected: T::KIND.type_name().to_owned(),
                found: entry.kind.type_name().to_owned(),
            })
    }
}

impl Transport for InProcess {
    fn sender<T: Sample>(
        &self,
        stream: &str,
        audience: Audience,
    ) -> Result<Box<dyn Sender<T>>, LinkError> {
        static INSTANCES: AtomicU64 = AtomicU64::new(0);
        Ok(Box::new(InProcessSender {
            channel: self.channel::<T>(stream)?,
            audience,
            patience: self.patience,
            instance: INSTANCES.fetch_add(1, Ordering::Relaxed),
            next: 0,
            slots: Vec::new(),
            cursor: 0,
            end: None,
            counts: SenderCounts::default(),
        }))
    }

    fn receiver<T: Sample>(
        &self,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Box<dyn Receiver<T>>, LinkError> {
        let channel = self.channel::<T>(stream)?;
        let queue = Arc::new(Queue::new(keep, depth.clamp(1, MAX_DEPTH)));
        lock(&channel.readers).push(Arc::clone(&queue));
        channel.joined.notify_all();
        Ok(Box::new(InProcessReceiver {
            queue,
            tracker: Tracker::of(stream),
        }))
    }
}

impl<T> Channel<T> {
    fn new() -> Self {
        Self {
            readers: Mutex::new(Vec::new()),
            joined: Condvar::new(),
        }
    }
}

struct InProcessSender<T> {
    channel: Arc<Channel<T>>,
    audience: Audience,
    patience: Duration,
    instance: u64,
    next: u64,
    /// Slots in use and free ones; at most as many as all readers together can hold.
    slots: Vec<Arc<T>>,
    cursor: usize,
    end: Option<(Arc<T>, Instant)>,
    counts: SenderCounts,
}

impl<T: Sample> InProcessSender<T> {
    /// Returns a slot that no reader holds, reset to the default.
    fn loan(&mut self) -> Arc<T> {
        for _ in 0..self.slots.len() {
            self.cursor = (self.cursor + 1) % self.slots.len();
            if Arc::strong_count(&self.slots[self.cursor]) == 1 {
                let mut slot = self.slots.swap_remove(self.cursor);
                if let Some(sample) = Arc::get_mut(&mut slot) {
                    *sample = T::default();
                    return slot;
                }
            }
        }
        Arc::new(T::default())
    }

    fn readers(&self) -> Readers<T> {
        let mut readers = lock(&self.channel.readers);
        readers.retain(|queue| !queue.is_closed());
        readers.clone()
    }
}

impl<T: Sample> Sender<T> for InProcessSender<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut slot = self.loan();
        if let Some(sample) = Arc::get_mut(&mut slot) {
            write(sample);
            sample.header_mut().sequence = self.next;
        }
        let sequence = self.next;
        self.next += 1;
        let mut delivered = 0;
        let mut refused = 0;
        for queue in self.readers() {
            let message = Message {
                instance: self.instance,
                sequence,
                payload: Arc::clone(&slot),
            };
            match (queue.push(message, self.patience), queue.keep()) {
                (Pushed::Taken, Keep::All) => delivered += 1,
                (Pushed::GaveOut, _) => refused += 1,
                (Pushed::Taken, Keep::Newest) | (Pushed::Closed, _) => {}
            }
        }
        self.slots.push(slot);
        self.counts.sent += 1;
        let missing = self.audience.keep_all.saturating_sub(delivered);
        self.counts.undelivered += missing.max(refused) as u64;
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        self.next += count;
    }

    fn end(&mut self) -> Result<(), LinkError> {
        let mut sample = T::default();
        sample.header_mut().flags = flags::END;
        sample.header_mut().sequence = self.next;
        let slot = Arc::new(sample);
        for queue in self.readers() {
            queue.push_over(Message {
                instance: self.instance,
                sequence: self.next,
                payload: Arc::clone(&slot),
            });
        }
        self.next += 1;
        self.end = Some((slot, Instant::now()));
        Ok(())
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let expected = self.audience;
        let missing = |readers: &mut Readers<T>| {
            readers.retain(|queue| !queue.is_closed());
            [Keep::All, Keep::Newest]
                .into_iter()
                .map(|keep| {
                    let there = readers.iter().filter(|q| q.keep() == keep).count();
                    expected.count(keep).saturating_sub(there)
                })
                .sum::<usize>()
        };
        let (mut readers, _) = self
            .channel
            .joined
            .wait_timeout_while(lock(&self.channel.readers), timeout, |readers| {
                missing(readers) > 0
            })
            .unwrap_or_else(PoisonError::into_inner);
        Ok(missing(&mut readers))
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        let Some((end, since)) = &self.end else {
            return Ok(Poll::Ready(0));
        };
        let holders = Arc::strong_count(end) - 1;
        Ok(if holders == 0 || since.elapsed() >= timeout {
            Poll::Ready(holders)
        } else {
            Poll::Pending
        })
    }

    fn counts(&self) -> SenderCounts {
        self.counts
    }
}

struct InProcessReceiver<T> {
    queue: Arc<Queue<Arc<T>>>,
    tracker: Tracker,
}

impl<T: Sample> Receiver<T> for InProcessReceiver<T> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError> {
        while let Some(message) = self.queue.pop(timeout) {
            let (begin, sample) = (self.queue.begin(), &*message.payload);
            if let Some(received) = self.tracker.take(begin, message.instance, sample, read) {
                return Ok(received);
            }
        }
        Ok(Received::Nothing)
    }

    fn register(&mut self, waker: &Waker) -> Option<Duration> {
        self.queue.register(waker);
        None
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

impl<T> Drop for InProcessReceiver<T> {
    fn drop(&mut self) {
        self.queue.close();
    }
}

// No code panics while it holds these locks, so a poisoned one still guards a consistent state.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
