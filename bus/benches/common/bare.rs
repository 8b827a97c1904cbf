//! Bare iceoryx2 with the payload of a stream: the lower bound on the cost of a link.

use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, Path, PortFactory as _, SemanticString as _,
};
use iceoryx2::service::ipc_threadsafe::Service;
use tauscope_bus::TwinState;

const LONG: Duration = Duration::from_secs(20);

fn node(place: &str) -> Node<Service> {
    let mut config = Config::default();
    let root = format!("/tmp/tauscope_{place}");
    config
        .global
        .set_root_path(&Path::new(root.as_bytes()).expect("a path"));
    config.global.prefix = FileName::new(format!("{place}_").as_bytes()).expect("a name");
    NodeBuilder::new()
        .config(&config)
        .create::<Service>()
        .expect("a node")
}

/// Sends samples.
pub struct BareSender {
    publisher: Publisher<Service, TwinState, ()>,
    notifier: Notifier<Service>,
    waiting: bool,
    _node: Node<Service>,
}

impl BareSender {
    /// Opens the stream and waits for its receiver. With `waiting`, the receiver sleeps until it is notified.
    pub fn open(place: &str, name: &str, waiting: bool) -> Self {
        let node = node(place);
        let service = name.try_into().expect("a name");
        let events = node.service_builder(&service).event().open_or_create();
        let notifier = events
            .expect("events")
            .notifier_builder()
            .create()
            .expect("a notifier");
        let samples = node
            .service_builder(&service)
            .publish_subscribe::<TwinState>()
            .open_or_create()
            .expect("samples");
        let publisher = samples.publisher_builder().create().expect("a publisher");
        let deadline = Instant::now() + LONG;
        while samples.dynamic_config().number_of_subscribers() == 0 {
            assert!(Instant::now() < deadline, "the other side does not come");
            std::thread::sleep(Duration::from_millis(1));
        }
        Self {
            publisher,
            notifier,
            waiting,
            _node: node,
        }
    }

    /// Lets `write` fill a sample in shared memory and sends it.
    pub fn send(&mut self, write: impl FnOnce(&mut TwinState)) {
        let mut sample = self.publisher.loan().expect("a sample");
        write(sample.payload_mut());
        sample.send().expect("sent");
        if self.waiting {
            self.notifier.notify().expect("woken");
        }
    }
}

/// Receives samples.
pub struct BareReceiver {
    subscriber: Subscriber<Service, TwinState, ()>,
    listener: Listener<Service>,
    waiting: bool,
    _node: Node<Service>,
}

impl BareReceiver {
    /// Opens the stream. With `waiting`, the receiver sleeps until it is notified.
    pub fn open(place: &str, name: &str, waiting: bool) -> Self {
        let node = node(place);
        let service = name.try_into().expect("a name");
        let events = node.service_builder(&service).event().open_or_create();
        let listener = events
            .expect("events")
            .listener_builder()
            .create()
            .expect("a listener");
        let samples = node
            .service_builder(&service)
            .publish_subscribe::<TwinState>()
            .open_or_create();
        let subscriber = samples
            .expect("samples")
            .subscriber_builder()
            .create()
            .expect("a subscriber");
        Self {
            subscriber,
            listener,
            waiting,
            _node: node,
        }
    }

    /// Passes the next sample to `read` in place.
    pub fn receive<R>(&mut self, read: impl FnOnce(&TwinState) -> R) -> R {
        loop {
            if let Some(sample) = self.subscriber.receive().expect("received") {
                return read(sample.payload());
            }
            if self.waiting {
                self.listener.timed_wait(|_| {}, LONG).expect("waited");
            } else {
                std::hint::spin_loop();
            }
        }
    }
}
