//! Links between the processes of one host, over iceoryx2.
//!
//! For each [`Keep`] in use (an iceoryx2 service either overflows or does not), a stream has a publish-subscribe
//! service and these event services:
//!
//! | service | kind | purpose |
//! | --- | --- | --- |
//! | `<stream>/all` or `<stream>/newest` | publish-subscribe | samples, type name as in [`SampleKind::type_name`](crate::SampleKind::type_name), user header [`Joined`] |
//! | same name | event | id 0: a sample was sent, or a sender has connected |
//! | same name with `/urgent`, for detections | event | id 0: an urgent sample or the end of the stream was sent |
//! | same name with `/back` | event | id 0: a receiver has taken the end of the stream; id 1 + (publisher id mod 255): a receiver is connected to this publisher |
//!
//! A receiver must acknowledge its connection to a sender. iceoryx2 itself treats a subscriber that has not mapped
//! the publisher's memory yet as connected, and drops samples that do not fit into its buffer.
//!
//! All files of a run are under `/tmp/tauscope_<domain>` and `/dev/shm/<domain>_*`. Settings are in code only:
//! configuration files of iceoryx2 on the host are ignored.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::config::Config;
use iceoryx2::node::{CleanupState, Node, NodeBuilder};
use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::prelude::{
    EventActivation, EventId, LogLevel, MessagingPattern, ServiceName, SignalHandlingMode,
    ZeroCopySend, set_log_level,
};
use iceoryx2::service::Service as _;
use iceoryx2::service::builder::event::{EventOpenError, EventOpenOrCreateError};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::ipc_threadsafe::Service;
use iceoryx2::service::port_factory::{event, publish_subscribe};

use super::{
    Audience, FanOut, Keep, LinkError, MAX_DEPTH, PATIENCE, Receiver, Sender, Transport, Wake,
};
use crate::sample::Sample;

mod backpressure;
mod domain;
mod leftovers;
mod receiver;
mod sender;

pub use domain::{Domain, DomainError};
pub use leftovers::{left_behind, remove_left_behind};

const TRANSPORT: &str = "iceoryx2";
/// Suffix of the event service for urgent samples.
const URGENT: &str = "/urgent";
/// Largest number of receivers of a stream per [`Keep`].
/// Resolution: shared memory.
pub const MAX_RECEIVERS: usize = 16;
/// Publishers of a service: one sender and its crashed predecessors that are not cleaned up yet.
/// Resolution: shared memory.
const MAX_SENDERS: usize = 4;
/// Timeout for opening a service that another process is creating or removing. iceoryx2 itself waits half a second
/// and then reports that the service does not exist, but on a busy machine its creation may take longer.
/// Resolution: start-up time.
const OPEN_WITHIN: Duration = Duration::from_secs(10);

/// Event of the back channel: a receiver has taken the end of the stream.
const END_TAKEN: EventId = EventId::new(0);
/// Largest event id of the back channel.
/// Resolution: shared memory; publishers whose ids are equal modulo this value share an event.
const MAX_EVENT: usize = 255;

/// User header of each sample.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
#[type_name("tauscope/Joined/1")]
struct Joined {
    /// Sequence number at which the newest receiver connected.
    since: u64,
}

/// Event of the back channel: a receiver is connected to the publisher of that id.
fn greeting(publisher: u128) -> EventId {
    EventId::new(1 + (publisher % MAX_EVENT as u128) as usize)
}

/// Streams between the processes of one [`Domain`]. Clones share one iceoryx2 node.
#[derive(Debug, Clone)]
pub struct SharedMemory {
    node: SharedNode,
    patience: Duration,
    receivers: usize,
    wake: Wake,
}

/// An iceoryx2 node, which may move between threads but not be used by two at once.
#[derive(Debug, Clone)]
struct SharedNode(Arc<Mutex<Node<Service>>>);

impl SharedNode {
    fn with<R>(&self, f: impl FnOnce(&Node<Service>) -> R) -> R {
        f(&self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Frees the resources of crashed processes: places in services, and the unread samples that a sender would wait
    /// for.
    fn clean_dead(&self) -> CleanupState {
        self.with(Node::try_cleanup_dead_nodes)
    }
}

type Samples<T> = publish_subscribe::PortFactory<Service, T, Joined>;
type Events = event::PortFactory<Service>;

impl SharedMemory {
    /// Joins `domain`.
    ///
    /// # Errors
    /// [`LinkError::Open`] if iceoryx2 cannot create its files.
    pub fn open(domain: &Domain) -> Result<Self, LinkError> {
        set_log_level(LogLevel::Error);
        let config = domain.config()?;
        let node = NodeBuilder::new()
            .config(&config)
            // The program has its own signal handlers.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Service>()
            .map_err(|error| open_error(domain.as_str(), &error))?;
        Ok(Self {
            node: SharedNode(Arc::new(Mutex::new(node))),
            patience: PATIENCE,
            receivers: MAX_RECEIVERS,
            wake: Wake::Event,
        })
    }

    /// Sets the stall timeout, by default [`PATIENCE`].
    #[must_use]
    pub fn with_patience(mut self, patience: Duration) -> Self {
        self.patience = patience;
        self
    }

    /// Sets the largest number of receivers per [`Keep`], by default [`MAX_RECEIVERS`]. Both ends of a stream must
    /// use the same value. Shared memory is reserved for all of these receivers.
    #[must_use]
    pub fn with_receivers(mut self, receivers: usize) -> Self {
        self.receivers = receivers.clamp(1, MAX_RECEIVERS);
        self
    }

    /// Sets the wake-up mode of receivers, by default [`Wake::Event`].
    #[must_use]
    pub fn with_wake(mut self, wake: Wake) -> Self {
        self.wake = wake;
        self
    }

    /// Frees the resources of crashed processes of this domain and returns the number of removed nodes. A supervisor
    /// calls this after it has reaped a child and before it restarts it: senders blocked by the crashed process
    /// continue at once.
    pub fn clean_dead_peers(&self) -> u64 {
        self.node.clean_dead().cleanups
    }

    fn samples<T: Sample>(&self, stream: &str, keep: Keep) -> Result<Samples<T>, LinkError> {
        let name = service_name(stream, keep, "")?;
        let config = self.config();
        retry(|| {
            self.node.with(|node| {
                node.service_builder(&name)
                    .publish_subscribe::<T>()
                    .user_header::<Joined>()
                    .enable_safe_overflow(keep == Keep::Newest)
                    .subscriber_max_buffer_size(MAX_DEPTH)
                    .subscriber_max_borrowed_samples(2)
                    .history_size(0)
                    .max_publishers(MAX_SENDERS)
                    .max_subscribers(self.receivers)
                    .max_nodes(self.receivers + MAX_SENDERS)
                    .open_or_create()
                    .map_err(|error| {
                        use PublishSubscribeOpenError as E;
                        use PublishSubscribeOpenOrCreateError::{
                            PublishSubscribeOpenError as Opening, SystemInFlux,
                        };
                        match error {
                            Opening(E::IncompatibleTypes) => {
                                Failure::Final(type_mismatch::<T>(stream, &name, &config))
                            }
                            SystemInFlux
                            | Opening(
                                // `InternalFailure` also occurs while another process creates the service.
                                E::IsMarkedForDestruction
                                | E::HangsInCreation
                                | E::DoesNotExist
                                | E::InternalFailure,
                            ) => Failure::Passing(open_error(stream, &error)),
                            _ => Failure::Final(open_error(stream, &error)),
                        }
                    })
            })
        })
    }

    fn events(&self, stream: &str, keep: Keep, suffix: &str) -> Result<Events, LinkError> {
        let name = service_name(stream, keep, suffix)?;
        retry(|| {
            self.node.with(|node| {
                node.service_builder(&name)
                    .event()
                    .event_id_max_value(MAX_EVENT)
                    .max_notifiers(self.receivers + MAX_SENDERS)
                    .max_listeners(self.receivers + MAX_SENDERS)
                    .max_nodes(self.receivers + MAX_SENDERS)
                    .open_or_create()
                    .map_err(|error| {
                        use EventOpenError as E;
                        use EventOpenOrCreateError::{EventOpenError as Opening, SystemInFlux};
                        let link_error = open_error(stream, &error);
                        match error {
                            SystemInFlux
                            | Opening(
                                // `InternalFailure` also occurs while another process creates the service.
                                E::IsMarkedForDestruction
                                | E::HangsInCreation
                                | E::DoesNotExist
                                | E::InternalFailure,
                            ) => Failure::Passing(link_error),
                            _ => Failure::Final(link_error),
                        }
                    })
            })
        })
    }

    fn config(&self) -> Config {
        self.node.with(|node| node.config().clone())
    }
}

impl Transport for SharedMemory {
    fn sender<T: Sample>(
        &self,
        stream: &str,
        audience: Audience,
    ) -> Result<Box<dyn Sender<T>>, LinkError> {
        self.clean_dead_peers();
        let mut links: Vec<Box<dyn Sender<T>>> = Vec::new();
        for keep in [Keep::All, Keep::Newest] {
            if audience.count(keep) > 0 {
                let sender =
                    sender::SharedMemorySender::open(self, stream, keep, audience.count(keep))?;
                links.push(Box::new(sender));
            }
        }
        match links.len() {
            1 => Ok(links.remove(0)),
            _ => Ok(Box::new(FanOut::new(links))),
        }
    }

    fn receiver<T: Sample>(
        &self,
        stream: &str,
        keep: Keep,
        depth: usize,
    ) -> Result<Box<dyn Receiver<T>>, LinkError> {
        self.clean_dead_peers();
        Ok(Box::new(receiver::SharedMemoryReceiver::open(
            self, stream, keep, depth,
        )?))
    }
}

fn service_name(stream: &str, keep: Keep, suffix: &str) -> Result<ServiceName, LinkError> {
    let policy = match keep {
        Keep::All => "all",
        Keep::Newest => "newest",
    };
    ServiceName::new(&format!("{stream}/{policy}{suffix}"))
        .map_err(|error| open_error(stream, &error))
}

fn open_error(stream: &str, error: &dyn std::fmt::Display) -> LinkError {
    LinkError::Open {
        stream: stream.to_owned(),
        transport: TRANSPORT,
        reason: error.to_string(),
    }
}

fn type_mismatch<T: Sample>(stream: &str, name: &ServiceName, config: &Config) -> LinkError {
    let found = Service::details(name, config, MessagingPattern::PublishSubscribe)
        .ok()
        .flatten()
        .map_or_else(
            || "another type".to_owned(),
            |details| {
                let payload = details
                    .static_details
                    .publish_subscribe()
                    .message_type_details()
                    .payload;
                format!("{} of {} bytes", payload.type_name(), payload.size())
            },
        );
    LinkError::TypeMismatch {
        stream: stream.to_owned(),
        expected: format!("{} of {} bytes", T::KIND.type_name(), size_of::<T>()),
        found,
    }
}

enum Failure {
    /// Transient failure, worth a retry.
    Passing(LinkError),
    Final(LinkError),
}

fn retry<R>(mut attempt: impl FnMut() -> Result<R, Failure>) -> Result<R, LinkError> {
    let deadline = Instant::now() + OPEN_WITHIN;
    loop {
        match attempt() {
            Ok(value) => return Ok(value),
            Err(Failure::Passing(_)) if Instant::now() < deadline => {
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(Failure::Passing(error) | Failure::Final(error)) => return Err(error),
        }
    }
}

/// Sleeps until a notification or the end of `timeout`, and passes the events to `heard`.
fn wait(
    listener: &Listener<Service>,
    timeout: Duration,
    mut heard: impl FnMut(EventActivation),
) -> Result<(), String> {
    let result = if timeout.is_zero() {
        listener.try_wait(&mut heard)
    } else {
        // iceoryx2 passes whole microseconds to the socket, for which 0 means no timeout.
        listener.timed_wait(&mut heard, timeout.max(Duration::from_micros(1)))
    };
    match result {
        // A signal may interrupt the wait; its handler has already run.
        Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}
