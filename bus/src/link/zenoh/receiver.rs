//! The receiving end over Zenoh.

use std::sync::Arc;
use std::time::Duration;

use zenoh::Wait as _;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;

use super::{Zenoh, encoding, open_error, policy, zenoh_reason};
use crate::link::queue::{Message, Queue};
use crate::link::sequence::Tracker;
use crate::link::{Keep, LinkError, MAX_DEPTH, Position, Received, Receiver, ReceiverCounts};
use crate::sample::{Sample, flags};

pub(super) struct ZenohReceiver<T> {
    stream: String,
    session: zenoh::Session,
    queue: Arc<Incoming<T>>,
    // In this order, so that a sender that hears of the one can reach the other.
    _token: LivelinessToken,
    _subscriber: Subscriber<()>,
    end_key: String,
    tracker: Tracker,
}

/// A sample, or the type that came instead.
type Incoming<T> = Queue<Result<T, String>>;

impl<T: Sample> ZenohReceiver<T> {
    pub(super) fn open(
        transport: &Zenoh,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Self, LinkError> {
        let session = &transport.session;
        let failed = |error: zenoh::Error| open_error(stream, &error);
        let queue = Arc::new(Incoming::<T>::new(keep, depth.clamp(1, MAX_DEPTH)));
        let (filled, patience) = (Arc::clone(&queue), transport.patience);
        let subscriber = session
            .declare_subscriber(stream.to_owned())
            .callback(move |sample| {
                let message = decode::<T>(&sample);
                let ends = matches!(&message.payload, Ok(s) if s.header().has(flags::END));
                if ends {
                    filled.push_over(message);
                } else {
                    // What is refused leaves a hole in the sequence, which the reader counts.
                    filled.push(message, patience);
                }
            })
            .wait()
            .map_err(failed)?;
        let id = format!("{:016x}", transport.unique());
        let token = session
            .liveliness()
            .declare_token(format!("{stream}/{}/{id}", policy(keep)))
            .wait()
            .map_err(failed)?;
        Ok(Self {
            stream: stream.to_owned(),
            session: session.clone(),
            queue,
            _token: token,
            _subscriber: subscriber,
            end_key: format!("{stream}/@end/{id}"),
            tracker: Tracker::default(),
        })
    }

    fn acknowledge_end(&self, instance: u64) -> Result<(), LinkError> {
        self.session
            .put(&self.end_key, instance.to_le_bytes())
            .congestion_control(CongestionControl::Block)
            .wait()
            .map_err(|error| LinkError::Receive {
                stream: self.stream.clone(),
                reason: zenoh_reason(&error),
            })
    }
}

fn decode<T: Sample>(sample: &zenoh::sample::Sample) -> Message<Result<T, String>> {
    let instance = sample
        .attachment()
        .and_then(|bytes| <[u8; 8]>::try_from(&*bytes.to_bytes()).ok())
        .map_or(0, u64::from_le_bytes);
    let payload = if *sample.encoding() == encoding(T::KIND) {
        bytemuck::try_pod_read_unaligned::<T>(&sample.payload().to_bytes()).map_err(|_| {
            format!(
                "{} bytes of {}",
                sample.payload().len(),
                T::KIND.type_name()
            )
        })
    } else {
        Err(sample.encoding().to_string())
    };
    Message {
        instance,
        sequence: payload
            .as_ref()
            .map_or(0, |sample| sample.header().sequence),
        payload,
    }
}

impl<T: Sample> Receiver<T> for ZenohReceiver<T> {
    fn receive(
        &mut self,
        timeout: Duration,
        read: &mut dyn FnMut(&T),
    ) -> Result<Received, LinkError> {
        while let Some(message) = self.queue.pop(timeout) {
            let sample = message.payload.map_err(|found| LinkError::TypeMismatch {
                stream: self.stream.clone(),
                expected: format!("{} of {} bytes", T::KIND.type_name(), size_of::<T>()),
                found,
            })?;
            let begin = self.queue.begin();
            let taken = self.tracker.take(begin, message.instance, &sample, read);
            if taken == Some(Received::End) {
                self.acknowledge_end(message.instance)?;
            }
            if let Some(received) = taken {
                return Ok(received);
            }
        }
        Ok(Received::Nothing)
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

impl<T> Drop for ZenohReceiver<T> {
    fn drop(&mut self) {
        // Lets a callback go that waits for room.
        self.queue.close();
    }
}
