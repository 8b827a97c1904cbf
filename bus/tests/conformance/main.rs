//! Conformance suite: the guarantees of every link, over each transport.

// Helpers outside a test function; the compared numbers are exact copies.
#![allow(clippy::unwrap_used, clippy::float_cmp)]

use std::time::{Duration, Instant};

use tauscope_bus::{
    Audience, Domain, Header, InProcess, JointState, Keep, LinkError, Received, Receiver, Sender,
    SharedMemory, Transport, TwinState, Wake, Zenoh, ZenohEndpoints, ZenohRouter,
    link::SpillSettings,
};

mod promises;

/// Timeout of a failing test.
const LONG: Duration = Duration::from_secs(20);
const STREAM: &str = "cell/stage";

/// Both sides of a transport, as independent as the transport allows.
trait Sides: Sized {
    type Transport: Transport;
    /// Whether a sender keeps samples for a stalled receiver.
    const REMEMBERS: bool;
    fn new(patience: Duration) -> Self;
    fn sending(&self) -> &Self::Transport;
    fn receiving(&self) -> &Self::Transport;
}

struct InProcessSides(InProcess);

impl Sides for InProcessSides {
    type Transport = InProcess;
    const REMEMBERS: bool = false;
    fn new(patience: Duration) -> Self {
        Self(InProcess::new().with_patience(patience))
    }
    fn sending(&self) -> &InProcess {
        &self.0
    }
    fn receiving(&self) -> &InProcess {
        &self.0
    }
}

struct SharedMemorySides {
    domain: Domain,
    sending: Option<SharedMemory>,
    receiving: Option<SharedMemory>,
}

impl Sides for SharedMemorySides {
    type Transport = SharedMemory;
    const REMEMBERS: bool = false;
    fn new(patience: Duration) -> Self {
        let domain = Domain::unique();
        let open = || Some(SharedMemory::open(&domain).unwrap().with_patience(patience));
        Self {
            sending: open(),
            receiving: open(),
            domain,
        }
    }
    fn sending(&self) -> &SharedMemory {
        self.sending.as_ref().unwrap()
    }
    fn receiving(&self) -> &SharedMemory {
        self.receiving.as_ref().unwrap()
    }
}

/// Shared memory with polling receivers.
struct LookingSides<const INTERVAL_MS: u64>(SharedMemorySides);

impl<const INTERVAL_MS: u64> Sides for LookingSides<INTERVAL_MS> {
    type Transport = SharedMemory;
    const REMEMBERS: bool = false;
    fn new(patience: Duration) -> Self {
        let mut sides = SharedMemorySides::new(patience);
        let wake = match INTERVAL_MS {
            0 => Wake::Spin,
            interval_ms => Wake::EveryMs(interval_ms),
        };
        sides.receiving = sides.receiving.take().map(|side| side.with_wake(wake));
        Self(sides)
    }
    fn sending(&self) -> &SharedMemory {
        self.0.sending()
    }
    fn receiving(&self) -> &SharedMemory {
        self.0.receiving()
    }
}

impl Drop for SharedMemorySides {
    fn drop(&mut self) {
        (self.sending, self.receiving) = (None, None);
        self.domain.remove().unwrap();
    }
}

/// Window of a sender larger than the queues of the receivers.
const SPILL: SpillSettings = SpillSettings {
    bytes: 1000 * size_of::<JointState>(),
    linger_ms: 0,
    waits: true,
};

/// Two directly connected sessions.
struct ZenohSides {
    sending: Zenoh,
    receiving: Zenoh,
}

impl Sides for ZenohSides {
    type Transport = Zenoh;
    const REMEMBERS: bool = true;
    fn new(patience: Duration) -> Self {
        let (sending, endpoint) = listening(|endpoints| Zenoh::open(endpoints, patience));
        Self {
            sending: sending.with_spill(SPILL),
            receiving: Zenoh::open(&connect(&endpoint), patience).unwrap(),
        }
    }
    fn sending(&self) -> &Zenoh {
        &self.sending
    }
    fn receiving(&self) -> &Zenoh {
        &self.receiving
    }
}

/// Two directly connected sessions, the sending one with a batching delay.
struct GatheringSides(ZenohSides);

impl Sides for GatheringSides {
    type Transport = Zenoh;
    const REMEMBERS: bool = true;
    fn new(patience: Duration) -> Self {
        let mut sides = ZenohSides::new(patience);
        sides.sending = sides.sending.with_spill(SpillSettings {
            linger_ms: 20,
            ..SPILL
        });
        Self(sides)
    }
    fn sending(&self) -> &Zenoh {
        &self.0.sending
    }
    fn receiving(&self) -> &Zenoh {
        &self.0.receiving
    }
}

/// Two sessions on two hosts, each of which has a router.
struct ZenohHostSides {
    sides: ZenohSides,
    _routers: [ZenohRouter; 2],
}

impl Sides for ZenohHostSides {
    type Transport = Zenoh;
    const REMEMBERS: bool = true;
    fn new(patience: Duration) -> Self {
        let (router_a, a) = listening(ZenohRouter::open);
        let (router_b, b) = listening(|endpoints| {
            ZenohRouter::open(&ZenohEndpoints {
                connect: vec![a.clone()],
                ..endpoints.clone()
            })
        });
        Self {
            _routers: [router_a, router_b],
            sides: ZenohSides {
                sending: Zenoh::open(&connect(&a), patience)
                    .unwrap()
                    .with_spill(SPILL),
                receiving: Zenoh::open(&connect(&b), patience).unwrap(),
            },
        }
    }
    fn sending(&self) -> &Zenoh {
        &self.sides.sending
    }
    fn receiving(&self) -> &Zenoh {
        &self.sides.receiving
    }
}

/// Opens a listener and returns its endpoint. Retries, because another process may take a free port first.
fn listening<R>(open: impl Fn(&ZenohEndpoints) -> Result<R, LinkError>) -> (R, String) {
    let mut attempts = (0..20).map(|_| {
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", port.local_addr().unwrap());
        drop(port);
        let endpoints = ZenohEndpoints {
            listen: vec![endpoint.clone()],
            connect: Vec::new(),
        };
        open(&endpoints).map(|opened| (opened, endpoint))
    });
    attempts.find_map(Result::ok).expect("no port is free")
}

fn connect(endpoint: &str) -> ZenohEndpoints {
    ZenohEndpoints {
        listen: Vec::new(),
        connect: vec![endpoint.to_owned()],
    }
}

/// Sends `count` samples that carry their number as stamp.
fn send(sender: &mut dyn Sender<JointState>, first: i64, count: i64) {
    for number in first..first + count {
        sender
            .send_with(&mut |sample| {
                assert_eq!(sample.header, Header::default(), "a fresh slot");
                sample.header.stamp_ns = number;
                sample.position[3] = number as f64;
            })
            .unwrap();
    }
}

/// The next sample's stamp; `None` at the end of the stream.
fn next(receiver: &mut dyn Receiver<JointState>) -> Option<i64> {
    let deadline = Instant::now() + LONG;
    loop {
        let mut stamp = None;
        let received = receiver.receive(Duration::from_millis(100), &mut |sample| {
            assert_eq!(sample.position[3], sample.header.stamp_ns as f64);
            stamp = Some(sample.header.stamp_ns);
        });
        match received.unwrap() {
            Received::Sample => return stamp,
            Received::End => return None,
            Received::Nothing => assert!(Instant::now() < deadline, "nothing came"),
        }
    }
}

fn take(receiver: &mut dyn Receiver<JointState>, count: usize) -> Vec<i64> {
    (0..count)
        .map(|_| next(receiver).expect("no end yet"))
        .collect()
}

fn take_to_end(receiver: &mut dyn Receiver<JointState>) -> Vec<i64> {
    std::iter::from_fn(|| next(receiver)).collect()
}

macro_rules! conforms {
    ($module:ident, $sides:ty) => {
        mod $module {
            use super::*;
            conforms!(@ $sides:
                order_is_kept, late_joiner_hears_the_rest, slow_reader_that_keeps_all_loses_nothing,
                slow_reader_that_keeps_the_newest_loses_the_oldest, stuck_reader_is_given_up_and_counted,
                receiver_gone_and_back, sender_gone_and_back, end_comes_last_and_once, end_is_waited_for,
                missing_receivers_are_told, another_type_is_refused, loss_over_a_restart_of_the_receiver_is_counted,
                what_is_skipped_is_lost,
                what_no_stage_may_see_is_refused_and_counted, what_a_late_joiner_missed_is_known);
        }
    };
    (@ $sides:ty: $($promise:ident),+) => {$(
        #[test]
        fn $promise() {
            promises::$promise::<$sides>();
        }
    )+};
}

conforms!(in_process, InProcessSides);
conforms!(shared_memory, SharedMemorySides);
conforms!(shared_memory_looked_at, LookingSides<5>);
conforms!(shared_memory_spinning, LookingSides<0>);
conforms!(zenoh, ZenohSides);
conforms!(zenoh_that_gathers, GatheringSides);
conforms!(zenoh_between_hosts, ZenohHostSides);
