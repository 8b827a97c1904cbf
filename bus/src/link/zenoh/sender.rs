//! The sending end over Zenoh.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::{Duration, Instant};

use zenoh::Wait as _;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind as Change;

use super::log::{Batch, Log};
use super::message::{Beside, Taken, Why};
use super::{Zenoh, data_key, encoding, last_chunk, open_error, policy, zenoh_reason};
use crate::link::{Audience, Keep, LinkError, Sender, SenderCounts, SpillSettings};
use crate::sample::{Sample, flags};

/// Largest message \[bytes\]: it fits into one batch of Zenoh, so that it is never fragmented.
/// Resolution: amount of data retransmitted after a loss.
const MESSAGE_BYTES: usize = 48 << 10;
/// Window for keep-newest receivers \[samples\], beyond which the oldest sample is discarded. Half of it is sent
/// without batching delay.
/// Resolution: memory, against the number of messages.
const NEWEST: usize = 64;
/// Poll interval for unacknowledged samples.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A sender with a retransmission window and a thread of its own, which starts with the first sample.
pub(super) struct ZenohSender<T: Sample> {
    stream: String,
    shared: Arc<Shared<T>>,
    /// Network ends, until the thread takes them.
    wire: Option<Wire>,
    settings: SpillSettings,
    /// Liveliness token; dropped first, so that receivers accept the next session of the sender.
    token: Option<LivelinessToken>,
    sent: u64,
}

/// Network ends of a sender.
struct Wire {
    publisher: Publisher<'static>,
    instance: u64,
    former: u64,
    _tokens: Subscriber<()>,
    _taken: Subscriber<()>,
}

struct Shared<T> {
    state: Mutex<State<T>>,
    /// Wakes the sending thread: new samples, acknowledgements or receivers.
    filled: Condvar,
    /// Wakes the stage: more room, or a change of the receivers.
    changed: Condvar,
}

/// State of the sending thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Thread {
    Sends,
    /// Waiting for a notification.
    Idle,
    /// Waiting for more samples to fill a message; of new samples, only urgent ones or a full message end this wait.
    Gathers,
    /// Sending without batching delay.
    Hurries,
}

struct State<T> {
    log: Log<T>,
    thread: Thread,
    /// Number of samples that are sent without batching delay.
    enough: usize,
    /// Time at which the sender was dropped; the thread then ends after `PATIENCE` at the latest.
    closed: Option<Instant>,
    failure: Option<LinkError>,
}

impl<T: Sample> ZenohSender<T> {
    pub(super) fn open(
        transport: &Zenoh,
        stream: &str,
        keep: Keep,
        audience: Audience,
    ) -> Result<Self, LinkError> {
        let session = &transport.session;
        let settings = transport.spill;
        let failed = |error: zenoh::Error| open_error(stream, &error);
        let most = match keep {
            Keep::All => settings.bytes / size_of::<T>(),
            Keep::Newest => NEWEST,
        };
        let shared = Arc::new(Shared {
            state: Mutex::new(State {
                log: Log::new(keep, audience, most, transport.patience),
                thread: Thread::Sends,
                enough: most_of_a_message::<T>().min(most / 2).max(1),
                closed: None,
                failure: None,
            }),
            filled: Condvar::new(),
            changed: Condvar::new(),
        });
        let instance = transport.unique();
        let publisher = session
            .declare_publisher(data_key(stream, keep))
            .encoding(encoding(T::KIND))
            .congestion_control(CongestionControl::Drop)
            // The sender itself batches samples into messages, so Zenoh must not wait for further messages.
            .express(true)
            .wait()
            .map_err(failed)?;
        let theirs = Arc::clone(&shared);
        let taken = session
            .declare_subscriber(format!("{stream}/@taken/*"))
            .callback(move |sample| {
                let Some(taken) = Taken::read(&sample.payload().to_bytes()) else {
                    return;
                };
                let id = last_chunk(sample.key_expr());
                theirs.change(|log, now| match taken.why {
                    Why::Leaves => log.leave(id),
                    why if taken.instance == instance => {
                        log.taken(id, (taken.next, taken.lost), why == Why::Misses, now);
                    }
                    _ => {}
                });
            })
            .wait()
            .map_err(failed)?;
        // Declared after the subscriber: a receiver that sees the token can send acknowledgements.
        let token = session
            .liveliness()
            .declare_token(format!("{stream}/@from/{instance:016x}"))
            .wait()
            .map_err(failed)?;
        let tokens = presence(session, stream, keep, &shared).map_err(failed)?;
        Ok(Self {
            stream: stream.to_owned(),
            shared,
            wire: Some(Wire {
                publisher,
                instance,
                former: transport.former,
                _tokens: tokens,
                _taken: taken,
            }),
            settings,
            token: Some(token),
            sent: 0,
        })
    }

    /// Starts the thread, once.
    fn start(&mut self) -> Result<(), LinkError> {
        let Some(wire) = self.wire.take() else {
            return Ok(());
        };
        let shared = Arc::clone(&self.shared);
        let stream = self.stream.clone();
        let linger = Duration::from_millis(self.settings.linger_ms);
        let thread = std::thread::Builder::new().name("zenoh link".to_owned());
        let started = thread.spawn(move || {
            if let Err(reason) = shared.pump(&wire, linger) {
                shared.lock().failure = Some(LinkError::Send { stream, reason });
                shared.changed.notify_all();
            }
        });
        started.map(|_| ()).map_err(|error| LinkError::Send {
            stream: self.stream.clone(),
            reason: format!("cannot start the sending thread: {error}"),
        })
    }

    /// Locks the state. A pausable sender first waits for room in its window.
    fn room(&mut self) -> Result<MutexGuard<'_, State<T>>, LinkError> {
        self.start()?;
        let mut state = self.shared.lock();
        while self.settings.waits && state.failure.is_none() && state.log.is_full(Instant::now()) {
            state = wait(&self.shared.changed, state, LOOK_EVERY);
        }
        match state.failure.take() {
            Some(error) => Err(error),
            None => Ok(state),
        }
    }
}

fn most_of_a_message<T>() -> usize {
    (MESSAGE_BYTES / size_of::<T>()).max(1)
}

/// Subscribes to the liveliness tokens of the receivers.
fn presence<T: Sample>(
    session: &zenoh::Session,
    stream: &str,
    keep: Keep,
    shared: &Arc<Shared<T>>,
) -> zenoh::Result<Subscriber<()>> {
    let theirs = Arc::clone(shared);
    session
        .liveliness()
        .declare_subscriber(format!("{stream}/{}/*", policy(keep)))
        .history(true)
        .callback(move |token| {
            let id = last_chunk(token.key_expr());
            let room = id.rsplit('.').next().and_then(|room| room.parse().ok());
            theirs.change(|log, now| match token.kind() {
                Change::Put => log.join(id, room.unwrap_or(1), now),
                Change::Delete => log.lose(id, now),
            });
        })
        .wait()
}

impl<T: Sample> Sender<T> for ZenohSender<T> {
    fn send_with(&mut self, write: &mut dyn FnMut(&mut T)) -> Result<(), LinkError> {
        let mut sample = T::default();
        write(&mut sample);
        let mut state = self.room()?;
        sample.header_mut().sequence = state.log.next();
        state.log.push(sample);
        let wakes = if sample.is_urgent() || state.log.waiting() >= state.enough {
            state.hurry()
        } else {
            state.thread == Thread::Idle
        };
        drop(state);
        if wakes {
            self.shared.filled.notify_one();
        }
        self.sent += 1;
        Ok(())
    }

    fn skip(&mut self, count: u64) {
        self.shared.lock().log.skip(count);
    }

    fn end(&mut self) -> Result<(), LinkError> {
        let mut mark = T::default();
        mark.header_mut().flags = flags::END;
        let mut state = self.room()?;
        mark.header_mut().sequence = state.log.next();
        state.log.push_end(mark, Instant::now());
        state.hurry();
        drop(state);
        self.shared.filled.notify_one();
        Ok(())
    }

    fn wait_for_receivers(&mut self, timeout: Duration) -> Result<usize, LinkError> {
        let deadline = Instant::now() + timeout;
        let mut state = self.shared.lock();
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let missing = state.log.missing();
            if missing == 0 || left.is_zero() || state.failure.is_some() {
                return Ok(missing);
            }
            state = wait(&self.shared.changed, state, left);
        }
    }

    fn poll_taken(&mut self, timeout: Duration) -> Result<Poll<usize>, LinkError> {
        let mut state = self.shared.lock();
        if let Some(error) = state.failure.take() {
            return Err(error);
        }
        if state.log.is_awaited(Instant::now(), timeout) {
            return Ok(Poll::Pending);
        }
        let untaken = state.log.untaken();
        if untaken > 0 {
            state.log.abandon();
        }
        Ok(Poll::Ready(untaken))
    }

    fn counts(&self) -> SenderCounts {
        SenderCounts {
            sent: self.sent,
            undelivered: self.shared.lock().log.undelivered(),
        }
    }
}

impl<T: Sample> Drop for ZenohSender<T> {
    /// The thread still sends the samples of the window, unless the process exits first.
    fn drop(&mut self) {
        self.token = None;
        let mut state = self.shared.lock();
        state.closed = Some(Instant::now());
        state.hurry();
        drop(state);
        self.shared.filled.notify_one();
    }
}

impl<T: Sample> Shared<T> {
    // No code panics while it holds the lock.
    fn lock(&self) -> MutexGuard<'_, State<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Log<T>, Instant)) {
        change(&mut self.lock().log, Instant::now());
        self.filled.notify_one();
        self.changed.notify_all();
    }

    /// Sends the samples of the window until the sender is dropped.
    fn pump(&self, wire: &Wire, linger: Duration) -> Result<(), String> {
        let most = most_of_a_message::<T>();
        let mut not_before = None;
        while let Some(batch) = self.next(most, not_before) {
            not_before = Instant::now().checked_add(linger);
            let beside = Beside {
                instance: wire.instance,
                since: batch.since,
                gap: batch.gap,
                former: wire.former,
            };
            wire.publisher
                .put(bytemuck::cast_slice::<T, u8>(&batch.samples))
                .attachment(beside.bytes())
                .wait()
                .map_err(|error| zenoh_reason(&error))?;
        }
        Ok(())
    }

    /// Waits for the next batch, unless urgent at least until `not_before`; `None` at the end.
    fn next(&self, most: usize, not_before: Option<Instant>) -> Option<Batch<T>> {
        let mut state = self.lock();
        loop {
            let now = Instant::now();
            state.log.look_back(now);
            let left = not_before.map_or(Duration::ZERO, |at| at.saturating_duration_since(now));
            let hurries = state.thread == Thread::Hurries || state.closed.is_some();
            if !left.is_zero() && !hurries && state.log.waiting() < state.enough {
                // Acknowledgements wake this thread as well.
                state.thread = Thread::Gathers;
                state = wait(&self.filled, state, left);
                continue;
            }
            if let Some(batch) = state.log.batch(most, now) {
                if !hurries || state.log.waiting() == 0 {
                    state.thread = Thread::Sends;
                }
                drop(state);
                self.changed.notify_all();
                return Some(batch);
            }
            let leaves = state.closed;
            if leaves
                .is_some_and(|at| state.log.is_empty() || at.elapsed() >= crate::link::PATIENCE)
            {
                return None;
            }
            state.thread = Thread::Idle;
            state = wait(&self.filled, state, LOOK_EVERY);
        }
    }
}

impl<T> State<T> {
    /// Ends the batching delay. Returns whether the thread must be woken.
    fn hurry(&mut self) -> bool {
        let before = std::mem::replace(&mut self.thread, Thread::Hurries);
        matches!(before, Thread::Idle | Thread::Gathers)
    }
}

fn wait<'a, T>(
    condition: &Condvar,
    state: MutexGuard<'a, State<T>>,
    timeout: Duration,
) -> MutexGuard<'a, State<T>> {
    condition
        .wait_timeout(state, timeout)
        .unwrap_or_else(PoisonError::into_inner)
        .0
}
