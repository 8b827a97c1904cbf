//! A bounded queue in front of a sender with slow receivers, so that the stage itself need not wait for them.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::{LinkError, Sender, SenderCounts};
use crate::sample::Sample;

/// Samples per hand-over to the sending thread.
/// Resolution: number of lock operations, against memory.
const CHUNK: usize = 64;
/// Empty chunks kept for reuse.
/// Resolution: memory, against the number of allocations.
const SPARE: usize = 8;

/// Limits of a [`Spill`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpillSettings {
    /// Memory of the queue, at most \[bytes\].
    pub bytes: usize,
    /// Batching delay: samples emitted within this time are sent together \[ms\].
    pub linger_ms: u64,
    /// Whether the stage waits while the queue is full, because its source can be paused. Otherwise a sample without
    /// room is discarded and counted.
    pub waits: bool,
}

/// A sender with a queue in front of it and a thread of its own, which starts with the first sample.
///
/// A sample without room leaves a gap in the sequence, which the receivers count as lost.
pub struct Spill<T> {
    shared: Arc<Shared<T>>,
    /// The wrapped sender, until the thread takes it.
    inner: Option<Box<dyn Sender<T>>>,
    settings: SpillSettings,
    /// Capacity of the queue \[samples\].
    most: usize,
    /// Stall timeout for a full queue, if `settings.waits`.
    patience: Duration,
    /// The stall timeout has expired, and there was no room since.
    stuck: bool,
    receivers: u64,
    sent: u64,
    overflowed: u64,
}

struct Shared<T> {
    state: Mutex<State<T>>,
    filled: Condvar,
    changed: Condvar,
}

struct State<T> {
    /// Samples, each with the number of samples lost right before it.
    chunks: VecDeque<Vec<(u64, T)>>,
    spare: Vec<Vec<(u64, T)>>,
    /// Number of samples that are not sent yet.
    held: usize,
    /// Time at which the stream ended or `held` last fell, whichever is later.
    moved: Instant,
    /// Samples lost since the last one that found room.
    skipped: u64,
    /// The thread waits for a notification.
    idle: bool,
    /// The stream has ended.
    ended: bool,
    /// The [`Spill`] was dropped.
    closed: bool,
    undelivered: u64,
    failure: Option<LinkError>,
    /// The wrapped sender, once it has sent the end.
    returned: Option<Box<dyn Sender<T>>>,
}

impl<T> Default for State<T> {
    fn default() -> Self {
        Self {
            chunks: VecDeque::new(),
            spare: Vec::new(),
            held: 0,
            moved: Instant::now(),
            skipped: 0,
            idle: false,
            ended: false,
            closed: false,
            undelivered: 0,
            failure: None,
            returned: None,
        }
    }
}

impl<T: Sample> Spill<T> {
    /// A queue in front of `inner`, which has this number of keep-all `receivers`.
    pub fn new(
        inner: Box<dyn Sender<T>>,
        settings: SpillSettings,
        patience: Duration,
        receivers: usize,
    ) -> Self {
        Self {
            shared: Arc::new(Shared {
                state: Mutex::default(),
                filled: Condvar::new(),
                changed: Condvar::new(),
            }),
            inner: Some(inner),
            settings,
            most: (settings.bytes / size_of::<T>()).max(CHUNK),
            patience,
            stuck: false,
            receivers: receivers as u64,
            sent: 0,
            overflowed: 0,
        }
    }

    /// Starts the thread, once.
    fn start(&mut self) -> Result<(), LinkError> {
        let Some(inner) = self.inner.take() else {
            return Ok(());
        };
        let shared = Arc::clone(&self.shared);
        let linger = Duration::from_millis(self.settings.linger_ms);
        let thread = std::thread::Builder::new().name("spill".to_owned());
        let started = thread.spawn(move || shared.pump(inner, linger));
        started.map(|_| ()).map_err(|error| LinkError::Send {
            stream: T::KIND.type_name().to_owned(),
            reason: format!("cannot start the sending thread: {error}"),
        })
    }
}

impl<T: Sample> Sender<T> for Spill<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        self.start()?;
        self.sent += 1;
        let mut state = self.shared.lock();
        if state.held >= self.most && self.settings.waits && !self.stuck {
            let most = self.most;
            let full = |state: &mut State<T>| state.held >= most && state.failure.is_none();
            state = wait(&self.shared.changed, state, self.patience, full);
        }
        if let Some(error) = state.failure.take() {
            return Err(error);
        }
        self.stuck = state.held >= self.most;
        if self.stuck {
            state.skipped += 1;
            self.overflowed += 1;
            drop(state);
            write(&mut T::default());
            return Ok(());
        }
        if state.chunks.back().is_none_or(|chunk| chunk.len() == CHUNK) {
            let chunk = state.spare.pop();
            let chunk = chunk.unwrap_or_else(|| Vec::with_capacity(CHUNK));
            state.chunks.push_back(chunk);
        }
        let skipped = std::mem::take(&mut state.skipped);
        if let Some(chunk) = state.chunks.back_mut() {
            chunk.push((skipped, T::default()));
            if let Some((_, slot)) = chunk.last_mut() {
                write(slot);
            }
        }
        state.held += 1;
        let idle = state.idle;
        drop(state);
        if idle {
            self.shared.filled.notify_one();
        }
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        self.shared.lock().skipped += count;
    }

    fn end(&mut self) -> Result<(), LinkError> {
        self.start()?;
        let mut state = self.shared.lock();
        state.ended = true;
        state.moved = Instant::now();
        drop(state);
        self.shared.filled.notify_one();
        Ok(())
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let inner = self.inner.as_mut();
        inner.map_or(Ok(0), |inner| inner.wait_for_receivers(timeout))
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        let mut state = self.shared.lock();
        if let Some(error) = state.failure.take() {
            return Err(error);
        }
        if !state.ended {
            return Ok(Poll::Ready(0));
        }
        let Some(inner) = &mut state.returned else {
            if state.moved.elapsed() < timeout {
                return Ok(Poll::Pending);
            }
            // Part of the stream is not even sent yet.
            state.undelivered += state.held as u64 * self.receivers;
            return Ok(Poll::Ready(self.receivers.max(1) as usize));
        };
        let taken = inner.poll_taken(timeout)?;
        state.undelivered = inner.counts().undelivered;
        Ok(taken)
    }

    fn counts(&self) -> SenderCounts {
        SenderCounts {
            sent: self.sent,
            undelivered: self.shared.lock().undelivered + self.overflowed * self.receivers,
        }
    }
}

impl<T> Drop for Spill<T> {
    /// The thread still sends the queued samples, unless the process exits first.
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.filled.notify_one();
    }
}

impl<T> Shared<T> {
    // Only a stage's own `write` may panic while this lock is held, and it leaves a complete sample behind.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Sample> Shared<T> {
    /// Sends the queued samples until the stream ends.
    fn pump(&self, mut inner: Box<dyn Sender<T>>, linger: Duration) {
        let result = self.send_all(&mut *inner, linger);
        let mut state = self.lock();
        match result {
            Ok(()) => {
                state.undelivered = inner.counts().undelivered;
                state.returned = Some(inner);
            }
            Err(error) => state.failure = Some(error),
        }
        drop(state);
        self.changed.notify_all();
    }

    fn send_all(&self, inner: &mut dyn Sender<T>, linger: Duration) -> Result<(), LinkError> {
        while let Some(mut chunk) = self.next(linger) {
            let count = chunk.len();
            for (skipped, sample) in chunk.drain(..) {
                if skipped > 0 {
                    inner.skip(skipped);
                }
                inner.send_with(&mut |slot| *slot = sample)?;
            }
            let mut state = self.lock();
            state.held -= count;
            state.moved = Instant::now();
            state.undelivered = inner.counts().undelivered;
            if state.spare.len() < SPARE {
                state.spare.push(chunk);
            }
            drop(state);
            self.changed.notify_all();
        }
        let (ended, skipped) = {
            let mut state = self.lock();
            (state.ended, std::mem::take(&mut state.skipped))
        };
        if ended {
            inner.skip(skipped);
            inner.end()?;
        }
        Ok(())
    }

    /// Waits for the oldest chunk; `None` at the end.
    fn next(&self, linger: Duration) -> Option<Vec<(u64, T)>> {
        let mut state = self.lock();
        if state.chunks.is_empty() && !linger.is_zero() && !state.ended && !state.closed {
            drop(state);
            std::thread::sleep(linger);
            state = self.lock();
        }
        loop {
            if let Some(chunk) = state.chunks.pop_front() {
                return Some(chunk);
            }
            if state.ended || state.closed {
                return None;
            }
            state.idle = true;
            state = self
                .filled
                .wait(state)
                .unwrap_or_else(PoisonError::into_inner);
            state.idle = false;
        }
    }
}

fn wait<'a, T>(
    changed: &Condvar,
    state: MutexGuard<'a, State<T>>,
    timeout: Duration,
    pending: impl FnMut(&mut State<T>) -> bool,
) -> MutexGuard<'a, State<T>> {
    changed
        .wait_timeout_while(state, timeout, pending)
        .unwrap_or_else(PoisonError::into_inner)
        .0
}

#[cfg(test)]
mod tests;
