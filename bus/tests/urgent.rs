//! Batching delay of samples, and urgent samples without it: alarms and commands.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use std::time::{Duration, Instant};

use tauscope_bus::link::SpillSettings;
use tauscope_bus::{
    Audience, Detection, Domain, JointState, Keep, Received, Receiver, Sample, Sender,
    SharedMemory, Transport, Verb, Wake, Zenoh, ZenohEndpoints, flags,
};

/// Batching delay of samples that are not urgent.
const WAIT: Duration = Duration::from_secs(3);
/// Delay up to which a sample was sent without batching delay.
const AT_ONCE: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(10);

fn calm(detection: &mut Detection) {
    detection.header.flags = flags::READY;
}

fn alarm(detection: &mut Detection) {
    detection.header.flags = flags::READY | flags::ALARM;
    detection.event = Detection::ONSET;
}

/// Time from `begin` to the next sample.
fn comes<T: Sample>(receiver: &mut dyn Receiver<T>, begin: Instant) -> Duration {
    let received = receiver.receive(WAIT * 3, &mut |_| {}).unwrap();
    assert_eq!(received, Received::Sample);
    begin.elapsed()
}

/// Checks that an alarm ends the batching delay. The first sample ensures that both ends are connected.
fn waits_but_for_an_alarm(transports: [&(impl Transport + Sync); 2]) {
    let [sending, receiving] = transports;
    let audience = Audience::of(Keep::Newest, 1);
    let mut sender: Box<dyn Sender<Detection>> = sending.sender("c/detect", audience).unwrap();
    std::thread::scope(|scope| {
        let hears = scope.spawn(|| {
            let mut receiver: Box<dyn Receiver<Detection>> =
                receiving.receiver("c/detect", Keep::Newest, 64).unwrap();
            comes(&mut *receiver, Instant::now());
            receiver
        });
        while sender
            .wait_for_receivers(Duration::from_millis(100))
            .unwrap()
            > 0
        {}
        sender.send_with(&mut calm).unwrap();
        let mut receiver = hears.join().unwrap();
        let begin = Instant::now();
        let sends = scope.spawn(move || {
            // Sent while the receiver waits.
            std::thread::sleep(Duration::from_millis(100));
            sender.send_with(&mut calm).unwrap();
            std::thread::sleep(Duration::from_millis(100));
            sender.send_with(&mut alarm).unwrap();
            sender
        });
        let (before, at_alarm) = (comes(&mut *receiver, begin), comes(&mut *receiver, begin));
        assert!(
            before <= at_alarm && at_alarm < AT_ONCE,
            "{before:?} {at_alarm:?}"
        );
        let mut sender = sends.join().unwrap();
        let begin = Instant::now();
        let sends = scope.spawn(move || {
            std::thread::sleep(Duration::from_millis(100));
            sender.send_with(&mut calm).unwrap();
            sender
        });
        let took = comes(&mut *receiver, begin);
        assert!(took > AT_ONCE, "sent without batching delay: {took:?}");
        drop(sends.join().unwrap());
    });
}

#[test]
fn a_publisher_in_shared_memory_is_woken_for_an_alarm_alone() {
    let domain = Domain::unique();
    let sending = SharedMemory::open(&domain).unwrap();
    let wake = Wake::EveryMsOrUrgent(WAIT.as_millis() as u64);
    let receiving = SharedMemory::open(&domain).unwrap().with_wake(wake);
    waits_but_for_an_alarm([&sending, &receiving]);
    drop((sending, receiving));
    domain.remove().unwrap();
}

/// Two sessions, the sending one with a batching delay.
fn sessions() -> [Zenoh; 2] {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let endpoint = format!("tcp/{}", port.local_addr().unwrap());
    drop(port);
    let ends = |listen: &[String], connect: &[String]| ZenohEndpoints {
        listen: listen.to_vec(),
        connect: connect.to_vec(),
    };
    let at = [endpoint];
    let sending = Zenoh::open(&ends(&at, &[]), PATIENCE).unwrap();
    [
        sending.with_spill(SpillSettings {
            bytes: 1 << 20,
            linger_ms: WAIT.as_millis() as u64,
            waits: true,
        }),
        Zenoh::open(&ends(&[], &at), PATIENCE).unwrap(),
    ]
}

#[test]
fn an_alarm_over_zenoh_waits_for_no_other_sample() {
    let [sending, receiving] = sessions();
    waits_but_for_an_alarm([&sending, &receiving]);
}

#[test]
fn a_command_over_zenoh_goes_at_once_and_so_does_what_fills_a_message() {
    let [sending, receiving] = sessions();
    let mut receiver: Box<dyn Receiver<JointState>> =
        receiving.receiver("c/ingest", Keep::All, 1024).unwrap();
    let audience = Audience::of(Keep::All, 1);
    let mut sender: Box<dyn Sender<JointState>> = sending.sender("c/ingest", audience).unwrap();
    assert_eq!(sender.wait_for_receivers(PATIENCE).unwrap(), 0);
    let begin = Instant::now();
    for number in 0..100_u32 {
        let is_command = number == 1;
        sender
            .send_with(&mut |state| {
                state.command.verb = if is_command {
                    Verb::Acknowledge as u32
                } else {
                    0
                };
            })
            .unwrap();
        if is_command {
            comes(&mut *receiver, begin);
            assert!(comes(&mut *receiver, begin) < AT_ONCE);
        }
    }
    // The samples of a full message are sent without batching delay; the rest waits.
    comes(&mut *receiver, begin);
    assert!(begin.elapsed() < AT_ONCE);
    sender.end().unwrap();
    let mut heard = 3;
    while receiver.receive(WAIT, &mut |_| {}).unwrap() == Received::Sample {
        heard += 1;
    }
    assert_eq!(heard, 100);
    assert!(begin.elapsed() < WAIT, "the end was delayed");
}
