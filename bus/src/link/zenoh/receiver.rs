//! The receiving end over Zenoh.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Waker;
use std::time::{Duration, Instant};

use zenoh::Wait as _;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::sample::SampleKind as Change;

use super::message::{Beside, Taken, Why, samples};
use super::speaker::Speakers;
use super::{Zenoh, data_key, encoding, instance_of, open_error, policy, zenoh_reason};
use crate::link::queue::{Message, Queue};
use crate::link::sequence::Tracker;
use crate::link::{Keep, LinkError, MAX_DEPTH, Position, Received, Receiver, ReceiverCounts};
use crate::sample::Sample;

/// Interval of acknowledgements; they are sent earlier when a quarter of the credit is used.
/// Resolution: the sender's memory, against traffic: an acknowledgement costs as much as a message of samples.
const TELL_EVERY: Duration = Duration::from_millis(100);
/// Shortest interval between acknowledgements that report a missing sample.
/// Resolution: the delay after a loss, against duplicates.
const MISSES_EVERY: Duration = Duration::from_millis(20);
/// Interval at which an idle receiver repeats its acknowledgement.
const TELL_AGAIN: Duration = Duration::from_secs(1);

pub(super) struct ZenohReceiver<T: Sample> {
    stream: String,
    keep: Keep,
    depth: usize,
    heard: Arc<Heard<T>>,
    // Dropped in this order: while a sender sees the token, the subscribers receive its samples.
    _token: LivelinessToken,
    _subscribers: [Subscriber<()>; 2],
    back: Publisher<'static>,
    tracker: Tracker,
    /// Last acknowledged position, and its time.
    told: Option<(Position, Instant)>,
    /// Samples lost before the sender's current session.
    lost_before: u64,
}

/// A sample with the attachment of its message.
struct Incoming<T> {
    since: u64,
    gap: u64,
    former: u64,
    sample: T,
}

/// State that the Zenoh callbacks update.
struct Heard<T> {
    stream: String,
    queue: Queue<Incoming<T>>,
    speakers: Mutex<Speakers>,
    foreign: AtomicU64,
    refused: AtomicU64,
}

impl<T: Sample> Heard<T> {
    // No code panics while it holds the lock.
    fn speakers(&self) -> MutexGuard<'_, Speakers> {
        self.speakers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Queues the samples of a message. Messages that are not from the stream's sender are refused and counted, with
    /// a warning for the first one.
    fn take(&self, message: &zenoh::sample::Sample) {
        let stream = &self.stream;
        let beside = message.attachment();
        let beside = beside.and_then(|bytes| Beside::read(&bytes.to_bytes()));
        let beside = beside.filter(|beside| self.speakers().hears(beside.instance));
        let Some(Beside {
            instance,
            since,
            mut gap,
            former,
        }) = beside
        else {
            if self.foreign.fetch_add(1, Ordering::Relaxed) == 0 {
                tracing::warn!(
                    "stream `{stream}`: messages that are not from its sender are refused and counted; another program \
                     publishes on its key"
                );
            }
            return;
        };
        let found = if *message.encoding() == encoding(T::KIND) {
            samples::<T>(&message.payload().to_bytes())
                .map_err(|length| format!("{length} bytes of {}", T::KIND.type_name()))
        } else {
            Err(message.encoding().to_string())
        };
        let samples = match found {
            Ok(samples) => samples,
            Err(found) => {
                if self.refused.fetch_add(1, Ordering::Relaxed) == 0 {
                    let (expected, size) = (T::KIND.type_name(), size_of::<T>());
                    tracing::warn!(
                        "stream `{stream}` carries {found}, expected {expected} of {size} bytes: refused and \
                         counted; run the same version on all hosts"
                    );
                }
                return;
            }
        };
        for sample in samples {
            let message = Message {
                instance,
                sequence: sample.header().sequence,
                payload: Incoming {
                    since,
                    gap,
                    former,
                    sample,
                },
            };
            gap = 0;
            // Under `Keep::All` a sample without room is requested again; under `Keep::Newest` the oldest is lost.
            self.queue.push(message, Duration::ZERO);
        }
    }
}

impl<T: Sample> ZenohReceiver<T> {
    pub(super) fn open(
        transport: &Zenoh,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Self, LinkError> {
        let session = &transport.session;
        let failed = |error: zenoh::Error| open_error(stream, &error);
        let depth = depth.clamp(1, MAX_DEPTH);
        let heard = Arc::new(Heard {
            stream: stream.to_owned(),
            queue: Queue::new(keep, depth),
            speakers: Mutex::default(),
            foreign: AtomicU64::new(0),
            refused: AtomicU64::new(0),
        });
        let tokens = Arc::clone(&heard);
        let senders = session
            .liveliness()
            .declare_subscriber(format!("{stream}/@from/*"))
            .history(true)
            .callback(move |token| {
                let Some(instance) = instance_of(token.key_expr()) else {
                    return;
                };
                match token.kind() {
                    Change::Put => tokens.speakers().appeared(instance),
                    Change::Delete => tokens.speakers().gone(instance),
                }
            })
            .wait()
            .map_err(failed)?;
        let taken = Arc::clone(&heard);
        let samples = session
            .declare_subscriber(data_key(stream, keep))
            .callback(move |message| taken.take(&message))
            .wait()
            .map_err(failed)?;
        let id = format!("{:016x}.{depth}", transport.unique());
        let back = session
            .declare_publisher(format!("{stream}/@taken/{id}"))
            .congestion_control(CongestionControl::Drop)
            .wait()
            .map_err(failed)?;
        let token = session
            .liveliness()
            .declare_token(format!("{stream}/{}/{id}", policy(keep)))
            .wait()
            .map_err(failed)?;
        Ok(Self {
            stream: stream.to_owned(),
            keep,
            depth,
            heard,
            _token: token,
            _subscribers: [senders, samples],
            back,
            tracker: Tracker::of(stream),
            told: None,
            lost_before: 0,
        })
    }

    /// Whether the sample is the next one available. Otherwise sends an acknowledgement, at a limited rate.
    fn is_next(&mut self, message: &Message<Incoming<T>>) -> Result<bool, LinkError> {
        if self.keep == Keep::Newest {
            return Ok(true);
        }
        let next = match self.tracker.position() {
            None => return Ok(true),
            Some(position) if position.instance == message.instance => position.next,
            // A new session counts from 0.
            Some(_) => 0,
        };
        let Incoming { since, gap, .. } = message.payload;
        if message.sequence < next {
            self.tell_now_and_then(message.instance, next, Why::Took)?;
            return Ok(false);
        }
        if message.sequence.saturating_sub(gap) > next.max(since) {
            self.tell_now_and_then(message.instance, next, Why::Misses)?;
            return Ok(false);
        }
        Ok(true)
    }

    /// Sends an acknowledgement, if one is due.
    fn tell_progress(&mut self, received: Received) -> Result<(), LinkError> {
        let Some(position) = self.tracker.position() else {
            return Ok(());
        };
        let due = match self.told {
            None => true,
            Some((told, at)) => {
                let taken = position.next.saturating_sub(told.next);
                let moved = told != position;
                moved
                    && (told.instance != position.instance
                        || taken >= (self.depth as u64 / 4).max(1)
                        || at.elapsed() >= TELL_EVERY)
                    || (received == Received::Nothing && at.elapsed() >= TELL_AGAIN)
            }
        };
        if due || received == Received::End {
            self.tell(position, Why::Took)?;
        }
        Ok(())
    }

    fn tell_now_and_then(&mut self, instance: u64, next: u64, why: Why) -> Result<(), LinkError> {
        if self.told.is_some_and(|(_, at)| at.elapsed() < MISSES_EVERY) {
            return Ok(());
        }
        self.tell(Position { instance, next }, why)
    }

    fn taken(&self, Position { instance, next }: Position, why: Why) -> Taken {
        let lost = self.tracker.counts().lost;
        Taken {
            instance,
            next,
            lost: lost.saturating_sub(self.lost_before),
            why,
        }
    }

    fn tell(&mut self, position: Position, why: Why) -> Result<(), LinkError> {
        self.told = Some((position, Instant::now()));
        let taken = self.taken(position, why);
        let put = self.back.put(taken.bytes()).wait();
        put.map_err(|error| LinkError::Receive {
            stream: self.stream.clone(),
            reason: zenoh_reason(&error),
        })
    }
}

impl<T: Sample> Receiver<T> for ZenohReceiver<T> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError> {
        let deadline = Instant::now() + timeout;
        let mut received = Received::Nothing;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let Some(message) = self.heard.queue.pop(left) else {
                break;
            };
            if !self.is_next(&message)? {
                continue;
            }
            let instance = message.instance;
            let begin = Position {
                instance,
                next: message.sequence,
            };
            // A keep-newest receiver has lost the samples discarded since its first one.
            let begin = match self.keep {
                Keep::All => Some(begin),
                Keep::Newest => self.heard.queue.begin(),
            };
            let present = self.tracker.position().map(|it| it.instance);
            if present != Some(instance) {
                self.tracker.hears_of_former_lives(message.payload.former);
                self.lost_before = self.tracker.counts().lost;
            }
            let sample = &message.payload.sample;
            let Some(taken) = self.tracker.take(begin, instance, sample, read) else {
                continue;
            };
            if taken == Received::End {
                self.heard.speakers().ends(instance);
            }
            received = taken;
            break;
        }
        self.tell_progress(received)?;
        Ok(received)
    }

    fn register(&mut self, waker: &Waker) -> Option<Duration> {
        self.heard.queue.register(waker);
        None
    }

    fn counts(&self) -> ReceiverCounts {
        let mut counts = self.tracker.counts();
        counts.foreign += self.heard.foreign.load(Ordering::Relaxed);
        counts.refused += self.heard.refused.load(Ordering::Relaxed);
        counts
    }

    fn position(&self) -> Option<Position> {
        self.tracker.position()
    }

    fn resume(&mut self, position: Position) {
        self.heard.speakers().resume(position.instance);
        self.tracker.resume(position);
    }
}

impl<T: Sample> Drop for ZenohReceiver<T> {
    fn drop(&mut self) {
        self.heard.queue.close();
        let nowhere = Position {
            instance: 0,
            next: 0,
        };
        let position = self.tracker.position().unwrap_or(nowhere);
        let taken = self.taken(position, Why::Leaves);
        // If this message is lost, the sender notices that the token is gone.
        let _ = self.back.put(taken.bytes()).wait();
    }
}
