//! A chain of dora nodes that hand on 1056 bytes: one sends a thousand samples a second, one writes the time into them,
//! some do nothing, and the last takes the time again and prints how long each took \[ns\].
//!
//! `run.sh` builds and runs it.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use dora_node_api::{DoraNode, Event, EventStream, MetadataParameters, dora_core::config::DataId};

/// As large as a sample of the stage `twin`.
const BYTES: usize = 1056;

fn now_ns() -> i64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    now.expect("a time after 1970").as_nanos() as i64
}

fn main() {
    let (mut node, events) = DoraNode::init_from_env().expect("started by dora");
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["play", samples] => play(&mut node, samples.parse().expect("a number")),
        ["hop"] => hop(&mut node, events, false),
        ["stamp"] => hop(&mut node, events, true),
        ["end", file] => end(events, file),
        other => panic!("no part of the chain: {other:?}"),
    }
}

fn send(node: &mut DoraNode, stamp: &[u8], received: &[u8]) {
    let output = DataId::from("sample".to_owned());
    let write = |slot: &mut [u8]| {
        slot[..8].copy_from_slice(stamp);
        slot[8..16].copy_from_slice(received);
    };
    node.send_output_raw(output, MetadataParameters::default(), BYTES, write)
        .expect("sent");
}

fn play(node: &mut DoraNode, samples: u64) {
    // Until all are connected.
    std::thread::sleep(Duration::from_secs(1));
    let begin = Instant::now();
    for number in 0..samples {
        let due = begin + Duration::from_millis(number);
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        send(node, &number.to_le_bytes(), &[0; 8]);
    }
}

fn hop(node: &mut DoraNode, mut events: EventStream, stamp: bool) {
    while let Some(event) = events.recv() {
        match event {
            Event::Input { data, .. } => {
                let bytes: &[u8] = (&data).try_into().expect("bytes");
                let now = now_ns().to_le_bytes();
                let received = if stamp { &now } else { &bytes[8..16] };
                send(node, &bytes[..8], received);
            }
            Event::InputClosed { .. } | Event::Stop(_) => return,
            _ => {}
        }
    }
}

fn end(mut events: EventStream, file: &str) {
    let mut latencies = String::new();
    while let Some(event) = events.recv() {
        match event {
            Event::Input { data, .. } => {
                let bytes: &[u8] = (&data).try_into().expect("bytes");
                let sent = i64::from_le_bytes(bytes[8..16].try_into().expect("eight"));
                latencies.push_str(&format!("{}\n", now_ns() - sent));
            }
            Event::InputClosed { .. } | Event::Stop(_) => break,
            _ => {}
        }
    }
    std::fs::write(file, latencies).expect("the folder can be written");
}
