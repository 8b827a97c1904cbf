//! Network failure between two hosts: lost samples are retransmitted once the network is back.

// Helpers outside a test function.
#![allow(clippy::unwrap_used)]

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use tauscope_bus::{
    Audience, JointState, Keep, Received, Receiver, Sender, Transport, Zenoh, ZenohEndpoints,
    ZenohRouter,
};

const LONG: Duration = Duration::from_secs(20);

/// Forwards connections to another address until it is cut.
struct Proxy {
    address: SocketAddr,
    cut: Arc<AtomicBool>,
    connections: Arc<Mutex<Vec<TcpStream>>>,
}

impl Proxy {
    fn to(target: SocketAddr) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let proxy = Self {
            address: listener.local_addr().unwrap(),
            cut: Arc::default(),
            connections: Arc::default(),
        };
        let (cut, connections) = (Arc::clone(&proxy.cut), Arc::clone(&proxy.connections));
        std::thread::spawn(move || {
            for near in listener.incoming().map(Result::unwrap) {
                if cut.load(Ordering::Relaxed) {
                    continue;
                }
                let Ok(far) = TcpStream::connect(target) else {
                    continue;
                };
                for (from, to) in [(&near, &far), (&far, &near)] {
                    let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                    std::thread::spawn(move || pass(from, to));
                }
                connections.lock().unwrap().extend([near, far]);
            }
        });
        proxy
    }

    /// Closes all connections and accepts no new ones.
    fn cut(&self) {
        self.cut.store(true, Ordering::Relaxed);
        for connection in self.connections.lock().unwrap().drain(..) {
            // It may be closed already.
            let _ = connection.shutdown(Shutdown::Both);
        }
    }

    fn mend(&self) {
        self.cut.store(false, Ordering::Relaxed);
    }
}

fn pass(mut from: TcpStream, mut to: TcpStream) {
    let mut buffer = [0; 4096];
    while let Ok(length) = from.read(&mut buffer) {
        if length == 0 || to.write_all(&buffer[..length]).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
}

fn missing_becomes(sender: &mut dyn Sender<JointState>, missing: usize) {
    let deadline = Instant::now() + LONG;
    while sender.wait_for_receivers(Duration::from_millis(5)).unwrap() != missing {
        assert!(Instant::now() < deadline, "never {missing} missing");
    }
}

#[test]
fn what_a_broken_network_swallows_comes_once_it_is_mended() {
    // Another process may take a free port first.
    let (a, address) = std::iter::repeat_with(|| {
        let port = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = port.local_addr().unwrap();
        drop(port);
        let listen = vec![format!("tcp/{address}")];
        let connect = Vec::new();
        Zenoh::open(&ZenohEndpoints { listen, connect }, LONG).map(|links| (links, address))
    })
    .take(20)
    .find_map(Result::ok)
    .expect("no port is free");
    let proxy = Proxy::to(address);
    let listen = Vec::new();
    let connect = vec![format!("tcp/{}", proxy.address)];
    let b = Zenoh::open(&ZenohEndpoints { listen, connect }, LONG).unwrap();
    let mut sender: Box<dyn Sender<JointState>> =
        a.sender("c/s", Audience::of(Keep::All, 1)).unwrap();
    let mut receiver: Box<dyn Receiver<JointState>> = b.receiver("c/s", Keep::All, 64).unwrap();
    let mut number = 0;
    let mut send = |sender: &mut dyn Sender<JointState>| {
        for _ in 0..10 {
            sender
                .send_with(&mut |sample| sample.header.stamp_ns = number)
                .unwrap();
            number += 1;
        }
    };
    missing_becomes(&mut *sender, 0);
    send(&mut *sender);
    let mut heard = Vec::new();
    while heard.len() < 10 {
        let read = &mut |sample: &JointState| heard.push(sample.header.stamp_ns);
        assert_eq!(receiver.receive(LONG, read).unwrap(), Received::Sample);
    }
    proxy.cut();
    missing_becomes(&mut *sender, 1);
    send(&mut *sender);
    proxy.mend();
    missing_becomes(&mut *sender, 0);
    send(&mut *sender);
    sender.end().unwrap();
    while receiver
        .receive(LONG, &mut |sample| heard.push(sample.header.stamp_ns))
        .unwrap()
        == Received::Sample
    {}
    assert_eq!(heard, (0..30).collect::<Vec<_>>());
    let counts = receiver.counts();
    assert_eq!((counts.received, counts.lost, counts.foreign), (30, 0, 0));
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    assert_eq!(sender.counts().undelivered, 0);
}

/// Endpoint with a free port.
fn free() -> String {
    let port = TcpListener::bind("127.0.0.1:0").unwrap();
    format!("tcp/{}", port.local_addr().unwrap())
}

/// Opens a router at `listen`, with retries while an earlier one still occupies the port.
fn router(listen: &str, connect: &[String]) -> ZenohRouter {
    let endpoints = ZenohEndpoints {
        listen: vec![listen.to_owned()],
        connect: connect.to_vec(),
    };
    let mut attempts = (0..100).map(|_| {
        let router = ZenohRouter::open(&endpoints);
        if router.is_err() {
            std::thread::sleep(Duration::from_millis(100));
        }
        router
    });
    attempts.find_map(Result::ok).expect("a router")
}

/// Two hosts, each with a router of its own, that are connected through a third router.
#[test]
fn a_router_that_is_started_again_costs_nothing() {
    let between = free();
    let first = router(&between, &[]);
    let host = || {
        let here = free();
        let router = router(&here, std::slice::from_ref(&between));
        let listen = Vec::new();
        let connect = vec![here];
        let endpoints = ZenohEndpoints { listen, connect };
        (router, Zenoh::open(&endpoints, LONG).unwrap())
    };
    let ((_near, a), (_far, b)) = (host(), host());
    let mut sender: Box<dyn Sender<JointState>> =
        a.sender("c/s", Audience::of(Keep::All, 1)).unwrap();
    let mut receiver: Box<dyn Receiver<JointState>> = b.receiver("c/s", Keep::All, 64).unwrap();
    let mut number = 0;
    let mut send = |sender: &mut dyn Sender<JointState>, count: usize| {
        for _ in 0..count {
            let write = &mut |sample: &mut JointState| sample.header.stamp_ns = number;
            sender.send_with(write).unwrap();
            number += 1;
        }
    };
    missing_becomes(&mut *sender, 0);
    send(&mut *sender, 50);
    drop(first);
    missing_becomes(&mut *sender, 1);
    send(&mut *sender, 50);
    let _second = router(&between, &[]);
    missing_becomes(&mut *sender, 0);
    send(&mut *sender, 50);
    sender.end().unwrap();
    let mut heard = Vec::new();
    while receiver
        .receive(LONG, &mut |sample| heard.push(sample.header.stamp_ns))
        .unwrap()
        == Received::Sample
    {}
    assert!(heard.into_iter().eq(0..150));
    assert_eq!(receiver.counts().dropped(), 0);
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
}
