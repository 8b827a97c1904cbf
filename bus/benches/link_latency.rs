//! Round-trip latency of a link between two processes, compared with bare iceoryx2 with the same payload.
//!
//! `cargo bench -p tauscope-bus --bench link_latency`
//!
//! - `bare, polling`: a publisher and a subscriber each way, both sides spinning: the lower bound.
//! - `bare, waiting`: the same, but the reader sleeps until an event notifies it of a sample.
//! - `link, shared memory`: a link, which waits in the same way.
//! - `bare zenoh`: publishers and subscribers of Zenoh alone, over TCP on the loopback device: the lower bound for
//!   `link, zenoh`.
//! - `link, zenoh`: a link over TCP on the loopback device.

// A measurement without its transport is void, so the benchmark may panic.
#![allow(clippy::unwrap_used)]

use std::process::{Child, Command};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use tauscope_bus::link::PATIENCE;
use tauscope_bus::{
    Audience, Domain, Keep, Received, Receiver, Sender, SharedMemory, Transport, TwinState, Zenoh,
    ZenohEndpoints,
};
use zenoh::Wait;
use zenoh::qos::CongestionControl;

#[path = "common/bare.rs"]
mod bare;

use bare::{BareReceiver, BareSender};

const WARM_UP: usize = 2_000;
const ROUNDS: usize = 50_000;
const LONG: Duration = Duration::from_secs(20);

/// One side of a ping-pong.
trait Side {
    fn send(&mut self, number: i64);
    fn receive(&mut self) -> i64;
}

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    if let [role, way, place] = arguments.as_slice()
        && role == "echo"
    {
        return echo(&mut *open(way, place, "pong", "ping"));
    }
    println!(
        "round trip of {} bytes between two processes [us], {ROUNDS} rounds",
        size_of::<TwinState>()
    );
    println!(
        "{:<22}{:>9}{:>9}{:>9}{:>9}",
        "", "p50", "p90", "p99", "p99.9"
    );
    let ways = [
        "bare, polling",
        "bare, waiting",
        "link, shared memory",
        "bare zenoh",
        "link, zenoh",
    ];
    let medians = ways.map(|way| {
        let histogram = measure(way);
        let at = |quantile| histogram.value_at_quantile(quantile) as f64 / 1e3;
        println!(
            "{way:<22}{:>9.2}{:>9.2}{:>9.2}{:>9.2}",
            at(0.5),
            at(0.9),
            at(0.99),
            at(0.999)
        );
        at(0.5)
    });
    println!(
        "link over shared memory: {:.2} times bare iceoryx2 that waits as well (p50)",
        medians[2] / medians[1]
    );
    println!(
        "link over Zenoh: {:.2} times Zenoh alone (p50)",
        medians[4] / medians[3]
    );
}

fn measure(way: &str) -> Histogram<u64> {
    let domain = Domain::unique();
    let place = if way.ends_with("zenoh") {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        format!("tcp/{}", listener.local_addr().unwrap())
    } else {
        domain.as_str().to_owned()
    };
    let mut other = other_process(way, &place);
    let mut side = open(way, &place, "ping", "pong");
    let mut histogram = Histogram::new(3).unwrap();
    for round in 0..WARM_UP + ROUNDS {
        let begin = Instant::now();
        side.send(round as i64);
        assert_eq!(side.receive(), round as i64);
        if round >= WARM_UP {
            histogram.record(begin.elapsed().as_nanos() as u64).unwrap();
        }
    }
    side.send(-1);
    other.wait().unwrap();
    drop(side);
    domain.remove().unwrap();
    histogram
}

fn other_process(way: &str, place: &str) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["echo", way, place])
        .spawn()
        .unwrap()
}

fn echo(side: &mut dyn Side) {
    loop {
        let number = side.receive();
        if number < 0 {
            return;
        }
        side.send(number);
    }
}

fn open(way: &str, place: &str, send: &str, receive: &str) -> Box<dyn Side> {
    match way {
        "bare, polling" => Box::new(Bare::open(place, send, receive, false)),
        "bare, waiting" => Box::new(Bare::open(place, send, receive, true)),
        "link, shared memory" => {
            let domain = Domain::new(place).unwrap();
            let links = SharedMemory::open(&domain).unwrap();
            Box::new(Linked::open(links, send, receive))
        }
        "bare zenoh" => Box::new(BareZenoh::open(place, send, receive)),
        _ => {
            let endpoint = vec![place.to_owned()];
            let mut endpoints = ZenohEndpoints::default();
            if send == "ping" {
                endpoints.listen = endpoint;
            } else {
                endpoints.connect = endpoint;
            }
            let links = Zenoh::open(&endpoints, PATIENCE).unwrap();
            Box::new(Linked::open(links, send, receive))
        }
    }
}

struct Linked<L> {
    sender: Box<dyn Sender<TwinState>>,
    receiver: Box<dyn Receiver<TwinState>>,
    /// Keeps the session open.
    _links: L,
}

impl<L: Transport> Linked<L> {
    fn open(links: L, send: &str, receive: &str) -> Self {
        let mut receiver = links.receiver(receive, Keep::All, 8).unwrap();
        let one = Audience::of(Keep::All, 1);
        let mut sender: Box<dyn Sender<TwinState>> = links.sender(send, one).unwrap();
        let deadline = Instant::now() + LONG;
        // A receiver in shared memory acknowledges new senders only within `receive`.
        while send == "ping" && sender.wait_for_receivers(Duration::from_millis(5)).unwrap() > 0 {
            assert!(Instant::now() < deadline, "the other side does not come");
            receiver
                .receive(Duration::ZERO, &mut |_: &TwinState| {})
                .unwrap();
        }
        Self {
            sender,
            receiver,
            _links: links,
        }
    }
}

impl<L: Transport> Side for Linked<L> {
    fn send(&mut self, number: i64) {
        self.sender
            .send_with(&mut |sample| sample.header.stamp_ns = number)
            .unwrap();
    }

    fn receive(&mut self) -> i64 {
        let mut number = None;
        let read = &mut |sample: &TwinState| number = Some(sample.header.stamp_ns);
        assert_eq!(self.receiver.receive(LONG, read).unwrap(), Received::Sample);
        number.unwrap()
    }
}

struct Bare {
    sender: BareSender,
    receiver: BareReceiver,
}

impl Bare {
    fn open(place: &str, send: &str, receive: &str, waiting: bool) -> Self {
        let receiver = BareReceiver::open(place, receive, waiting);
        let sender = BareSender::open(place, send, waiting);
        Self { sender, receiver }
    }
}

impl Side for Bare {
    fn send(&mut self, number: i64) {
        self.sender.send(|sample| sample.header.stamp_ns = number);
    }

    fn receive(&mut self) -> i64 {
        self.receiver.receive(|sample| sample.header.stamp_ns)
    }
}

/// Publisher and subscriber of one session, without sequence numbers, retransmission window or thread.
struct BareZenoh {
    publisher: zenoh::pubsub::Publisher<'static>,
    received: mpsc::Receiver<i64>,
    _subscriber: zenoh::pubsub::Subscriber<()>,
    _session: zenoh::Session,
}

impl BareZenoh {
    fn open(place: &str, send: &str, receive: &str) -> Self {
        let mut config = zenoh::Config::default();
        let way = if send == "ping" { "listen" } else { "connect" };
        for (key, value) in [
            ("mode", "\"peer\"".to_owned()),
            ("scouting/multicast/enabled", "false".to_owned()),
            ("listen/endpoints", "[]".to_owned()),
            (&format!("{way}/endpoints"), format!("[\"{place}\"]")),
        ] {
            config.insert_json5(key, &value).unwrap();
        }
        let session = zenoh::open(config).wait().unwrap();
        let (heard, received) = mpsc::sync_channel(8);
        let subscriber = session
            .declare_subscriber(receive.to_owned())
            .callback(move |sample| {
                let bytes = sample.payload().to_bytes();
                let number = bytes.first_chunk().copied().map(i64::from_le_bytes);
                heard.send(number.unwrap()).unwrap();
            })
            .wait()
            .unwrap();
        let publisher = session
            .declare_publisher(send.to_owned())
            .congestion_control(CongestionControl::Drop)
            .express(true)
            .wait()
            .unwrap();
        let deadline = Instant::now() + LONG;
        while !publisher.matching_status().wait().unwrap().matching() {
            assert!(Instant::now() < deadline, "the other side does not come");
            std::thread::sleep(Duration::from_millis(5));
        }
        Self {
            publisher,
            received,
            _subscriber: subscriber,
            _session: session,
        }
    }
}

impl Side for BareZenoh {
    fn send(&mut self, number: i64) {
        let mut bytes = vec![0; size_of::<TwinState>()];
        bytes[..8].copy_from_slice(&number.to_le_bytes());
        self.publisher.put(bytes).wait().unwrap();
    }

    fn receive(&mut self) -> i64 {
        self.received.recv_timeout(LONG).unwrap()
    }
}
