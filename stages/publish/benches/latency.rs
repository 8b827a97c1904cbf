//! Latency from a detection at the publisher to its message at a subscriber: percentiles, over loopback.
//!
//!     cargo bench -p tauscope-publish --bench latency

#![allow(
    clippy::unwrap_used,
    reason = "a failed set-up is a failed measurement"
)]

#[path = "../tests/common/mod.rs"]
mod common;

use std::sync::mpsc;
use std::time::{Duration, Instant};

use common::{endpoint, feed, publisher, says, session, until};
use hdrhistogram::Histogram;
use tauscope_bus::{SampleRef, Sink};
use tauscope_publish::Publisher;
use tokio_modbus::client::tcp;
use tokio_modbus::prelude::Reader as _;
use zenoh::Wait as _;

const SAMPLES: i64 = 5_000;
/// 500 samples a second.
const PERIOD: Duration = Duration::from_millis(2);

fn main() {
    for (name, key) in [
        ("ROS 2 Bool on `free`", "0/press_1/free/**"),
        ("JSON on `alarm`", "press-1/alarm"),
    ] {
        show(name, &over_zenoh(key));
    }
    show("Modbus: read of `free`", &over_modbus());
}

/// Feeds a detection that changes the alarm each time.
fn alternating(publisher: &mut Publisher, at: i64) {
    let detection = says(at, if at % 2 == 0 { "contact" } else { "free" });
    publisher
        .accept("detect", SampleRef::Detection(&detection))
        .unwrap();
}

fn over_zenoh(key: &str) -> Histogram<u64> {
    let endpoint = endpoint();
    let mut publisher = publisher(
        &format!("{{zenoh: {{listen: [{endpoint}], ros2: {{}}}}}}"),
        None,
    );
    let session = session(&endpoint);
    let (tell, told) = mpsc::channel();
    session
        .declare_subscriber(key.to_owned())
        .callback(move |_| {
            let _ = tell.send(Instant::now());
        })
        .background()
        .wait()
        .unwrap();
    let mut ms = -1_000_000;
    until("heard", || {
        ms += 200;
        feed(&mut publisher, &says(ms, "free"));
        told.try_recv().is_ok()
    });
    std::thread::sleep(Duration::from_millis(200));
    while told.try_recv().is_ok() {}
    let mut histogram = histogram();
    for at in 0..SAMPLES {
        let begin = Instant::now();
        alternating(&mut publisher, at);
        let arrived = told.recv_timeout(Duration::from_secs(5)).unwrap();
        histogram
            .record((arrived - begin).as_nanos() as u64)
            .unwrap();
        while told.try_recv().is_ok() {}
        std::thread::sleep(PERIOD.saturating_sub(begin.elapsed()));
    }
    histogram
}

fn over_modbus() -> Histogram<u64> {
    let mut publisher = publisher("{modbus: {listen: '127.0.0.1:0'}}", None);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build()
        .unwrap();
    let connected = tcp::connect(publisher.modbus_address().unwrap());
    let mut plc = runtime.block_on(connected).unwrap();
    let mut histogram = histogram();
    for at in 0..SAMPLES {
        let begin = Instant::now();
        alternating(&mut publisher, at);
        let read = runtime.block_on(plc.read_discrete_inputs(0, 1));
        let free = read.unwrap().unwrap()[0];
        histogram.record(begin.elapsed().as_nanos() as u64).unwrap();
        assert_eq!(free, at % 2 != 0, "the read shows the sample before it");
        std::thread::sleep(PERIOD.saturating_sub(begin.elapsed()));
    }
    histogram
}

fn histogram() -> Histogram<u64> {
    Histogram::new(3).unwrap()
}

fn show(name: &str, histogram: &Histogram<u64>) {
    let us = |quantile: f64| histogram.value_at_quantile(quantile) as f64 / 1e3;
    println!(
        "{name:<24} p50 {:7.0} us   p90 {:7.0} us   p99 {:7.0} us   max {:7.0} us   ({} samples)",
        us(0.5),
        us(0.9),
        us(0.99),
        us(1.0),
        histogram.len()
    );
}
