//! A participant of the network that is not a stage of the pipeline, over a real session: none of its messages is
//! accepted, ends a stream or stops a stage.

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::net::TcpListener;
use std::time::{Duration, Instant};

use tauscope_bus::{
    Audience, JointState, Keep, Received, Receiver, Sender, Transport, Zenoh, ZenohEndpoints, flags,
};
use zenoh::Wait as _;
use zenoh::bytes::Encoding;

const LONG: Duration = Duration::from_secs(20);
const KIND: &str = "tauscope/JointState/2";

/// A sending stage, a receiving stage, and a stranger on the same network.
struct Scene {
    sender: Box<dyn Sender<JointState>>,
    receiver: Box<dyn Receiver<JointState>>,
    stranger: zenoh::Session,
    /// Keeps the sessions open: a session ends with its last transport.
    _links: [Zenoh; 2],
}

fn scene(keep: Keep) -> Scene {
    // Another process may take a free port first.
    let (links, endpoint) = std::iter::repeat_with(|| {
        let port = TcpListener::bind("127.0.0.1:0").unwrap();
        let endpoint = format!("tcp/{}", port.local_addr().unwrap());
        drop(port);
        let listen = vec![endpoint.clone()];
        let connect = Vec::new();
        Zenoh::open(&ZenohEndpoints { listen, connect }, LONG).map(|links| (links, endpoint))
    })
    .take(20)
    .find_map(Result::ok)
    .expect("no port is free");
    let there = ZenohEndpoints {
        listen: Vec::new(),
        connect: vec![endpoint],
    };
    let receiver = links.receiver("cell/ingest", keep, 64).unwrap();
    let other = Zenoh::open(&there, LONG).unwrap();
    let mut sender = other.sender("cell/ingest", Audience::of(keep, 1)).unwrap();
    assert_eq!(sender.wait_for_receivers(LONG).unwrap(), 0);
    let stranger = there.session().unwrap();
    reaches(&stranger, keep);
    Scene {
        sender,
        receiver,
        stranger,
        _links: [links, other],
    }
}

/// Waits until the stranger's session has discovered the receiver.
fn reaches(stranger: &zenoh::Session, keep: Keep) {
    let key = match keep {
        Keep::All => "cell/ingest",
        Keep::Newest => "cell/ingest/@newest",
    };
    let publisher = stranger.declare_publisher(key).wait().unwrap();
    let deadline = Instant::now() + LONG;
    while !publisher.matching_status().wait().unwrap().matching() {
        assert!(Instant::now() < deadline, "nobody listens");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn state(stamp: i64) -> JointState {
    let mut state = JointState::default();
    state.header.stamp_ns = stamp;
    state
}

/// Attachment of a message from this sender.
fn beside(instance: u64) -> Vec<u8> {
    [instance, 0, 0, 0].map(u64::to_le_bytes).concat()
}

impl Scene {
    fn send(&mut self, stamps: std::ops::Range<i64>) {
        for stamp in stamps {
            let write = &mut |sample: &mut JointState| sample.header.stamp_ns = stamp;
            self.sender.send_with(write).unwrap();
        }
    }

    fn take(&mut self, count: usize) -> Vec<i64> {
        let mut stamps = Vec::new();
        let deadline = Instant::now() + LONG;
        while stamps.len() < count {
            assert!(Instant::now() < deadline, "{stamps:?} came");
            let read = &mut |sample: &JointState| stamps.push(sample.header.stamp_ns);
            let received = self.receiver.receive(Duration::from_millis(50), read);
            assert_ne!(received.unwrap(), Received::End);
        }
        stamps
    }

    fn says(&self, key: &str, kind: &str, payload: &[u8], beside: Option<Vec<u8>>) {
        let put = self.stranger.put(key, payload);
        let put = put.encoding(Encoding::ZENOH_BYTES.with_schema(kind));
        match beside {
            Some(beside) => put.attachment(beside).wait().unwrap(),
            None => put.wait().unwrap(),
        }
    }

    /// Waits until `foreign` messages have been refused; no sample may arrive meanwhile.
    fn refuses(&mut self, foreign: u64) {
        let deadline = Instant::now() + LONG;
        while self.receiver.counts().foreign < foreign {
            assert!(Instant::now() < deadline, "{:?}", self.receiver.counts());
            let read = &mut |_: &JointState| panic!("a stranger is heard");
            let received = self.receiver.receive(Duration::from_millis(10), read);
            assert_eq!(received.unwrap(), Received::Nothing);
        }
    }

    fn ends_in_order(mut self, sent: u64, foreign: u64) {
        self.sender.end().unwrap();
        let end = self.receiver.receive(LONG, &mut |_| {}).unwrap();
        assert_eq!(end, Received::End);
        assert_eq!(self.sender.wait_until_taken(LONG).unwrap(), 0);
        let counts = self.receiver.counts();
        assert_eq!((counts.received, counts.dropped()), (sent, 0));
        assert_eq!(counts.foreign, foreign);
    }
}

#[test]
fn an_end_mark_of_a_stranger_ends_nothing() {
    for (keep, key) in [
        (Keep::All, "cell/ingest"),
        (Keep::Newest, "cell/ingest/@newest"),
    ] {
        let mut scene = scene(keep);
        scene.send(0..3);
        assert_eq!(scene.take(3), [0, 1, 2]);
        let mut end = state(0);
        end.header.flags = flags::END;
        end.header.sequence = 3;
        for beside in [None, Some(vec![7; 8]), Some(beside(7))] {
            scene.says(key, KIND, bytemuck::bytes_of(&end), beside);
        }
        scene.refuses(3);
        scene.send(3..5);
        assert_eq!(scene.take(2), [3, 4]);
        scene.ends_in_order(5, 3);
    }
}

#[test]
fn joint_states_of_a_stranger_are_not_taken_as_real() {
    let mut scene = scene(Keep::All);
    // A forged sample before the first real one.
    let forged = state(999);
    scene.says(
        "cell/ingest",
        KIND,
        bytemuck::bytes_of(&forged),
        Some(beside(1)),
    );
    scene.refuses(1);
    scene.send(0..3);
    assert_eq!(scene.take(3), [0, 1, 2]);
    // A token does not make a stranger the sender while the real sender is alive.
    let token = scene.stranger.liveliness();
    let _token = token
        .declare_token("cell/ingest/@from/0000000000000007")
        .wait();
    std::thread::sleep(Duration::from_millis(200));
    scene.says(
        "cell/ingest",
        KIND,
        bytemuck::bytes_of(&forged),
        Some(beside(7)),
    );
    scene.refuses(2);
    scene.ends_in_order(3, 2);
}

#[test]
fn messages_of_a_wrong_type_or_length_end_no_run() {
    let mut scene = scene(Keep::All);
    scene.send(0..1);
    assert_eq!(scene.take(1), [0]);
    for _ in 0..5 {
        scene.says("cell/ingest", "tauscope/Detection/4", &[0; 384], None);
        scene.says("cell/ingest", KIND, &[0; 7], None);
        scene.says("cell/ingest", KIND, &[], Some(beside(7)));
    }
    scene.refuses(15);
    scene.send(1..3);
    assert_eq!(scene.take(2), [1, 2]);
    scene.ends_in_order(3, 15);
}

#[test]
fn a_flood_of_a_stranger_keeps_nobody_from_hearing_the_sender() {
    let mut scene = scene(Keep::All);
    let mut forged = vec![state(999); 40];
    for (number, state) in (0..).zip(&mut forged) {
        state.header.sequence = number;
        state.header.joint_count = 4_000_000_000;
    }
    let flood = bytemuck::cast_slice::<JointState, u8>(&forged);
    let mut heard = Vec::new();
    for stamp in 0..200 {
        for _ in 0..5 {
            scene.says("cell/ingest", KIND, flood, Some(beside(7)));
        }
        scene.send(stamp..stamp + 1);
        heard.extend(scene.take(1));
    }
    assert!(heard.into_iter().eq(0..200));
    let foreign = scene.receiver.counts().foreign;
    assert!(foreign > 0);
}

#[test]
fn what_a_stranger_says_in_the_name_of_a_receiver_harms_no_sender() {
    let mut scene = scene(Keep::All);
    let nonsense = [u64::MAX; 4].map(u64::to_le_bytes).concat();
    for payload in [&nonsense[..], &nonsense[..9], &[]] {
        scene.says("cell/ingest/@taken/unknown.64", "", payload, None);
    }
    let token = scene.stranger.liveliness();
    // Credits that overflow, are negative or are missing.
    for id in ["x.99999999999999999999", "y.-1", "z"] {
        let token = token.declare_token(format!("cell/ingest/@all/{id}")).wait();
        token.unwrap().undeclare().wait().unwrap();
    }
    scene.send(0..50);
    assert!(scene.take(50).into_iter().eq(0..50));
}
