use super::*;
use crate::link::{Audience, InProcess, Keep, Received, Receiver, Transport as _};
use crate::sample::JointState;

const LONG: Duration = Duration::from_secs(20);
const DEPTH: usize = 16;

/// A queue for `samples` in front of a receiver that takes nothing yet.
fn spilled(samples: usize, waits: bool) -> (Spill<JointState>, Box<dyn Receiver<JointState>>) {
    let links = InProcess::new().with_patience(LONG);
    let receiver = links.receiver("c/s", Keep::All, DEPTH).unwrap();
    let inner = links.sender("c/s", Audience::of(Keep::All, 1)).unwrap();
    let settings = SpillSettings {
        bytes: samples * size_of::<JointState>(),
        linger_ms: 1,
        waits,
    };
    let patience = Duration::from_millis(50);
    (Spill::new(inner, settings, patience, 1), receiver)
}

fn send(sender: &mut Spill<JointState>, stamps: std::ops::Range<i64>) {
    for stamp in stamps {
        let write = &mut |sample: &mut JointState| sample.header.stamp_ns = stamp;
        sender.send_with(write).unwrap();
    }
}

fn take_to_end(receiver: &mut dyn Receiver<JointState>) -> Vec<i64> {
    let mut stamps = Vec::new();
    let read = &mut |sample: &JointState| stamps.push(sample.header.stamp_ns);
    while receiver.receive(LONG, read).unwrap() == Received::Sample {}
    stamps
}

#[test]
fn the_stage_does_not_wait_for_a_receiver_that_takes_nothing_and_nothing_is_lost() {
    let (mut sender, mut receiver) = spilled(1_000, false);
    let begin = Instant::now();
    send(&mut sender, 0..1_000);
    sender.end().unwrap();
    assert!(begin.elapsed() < LONG / 2);
    assert!(take_to_end(&mut *receiver).into_iter().eq(0..1_000));
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    assert_eq!(receiver.counts().lost, 0);
    assert_eq!(
        (sender.counts().sent, sender.counts().undelivered),
        (1_000, 0)
    );
}

#[test]
fn what_has_no_room_is_counted_at_both_ends() {
    let (mut sender, mut receiver) = spilled(100, false);
    send(&mut sender, 0..1_000);
    sender.end().unwrap();
    let got = take_to_end(&mut *receiver).len() as u64;
    assert!(got < 1_000, "{got}");
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    assert_eq!(receiver.counts().lost, 1_000 - got);
    assert_eq!(sender.counts().undelivered, 1_000 - got);
}

#[test]
fn a_source_that_can_wait_waits_for_room() {
    let (mut sender, mut receiver) = spilled(100, true);
    sender.patience = LONG;
    let got = std::thread::scope(|scope| {
        let got = scope.spawn(|| take_to_end(&mut *receiver));
        send(&mut sender, 0..5_000);
        sender.end().unwrap();
        got.join().unwrap()
    });
    assert!(got.into_iter().eq(0..5_000));
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
}

#[test]
fn a_stage_that_goes_leaves_what_waits_to_be_sent_and_no_end() {
    let (mut sender, mut receiver) = spilled(1_000, false);
    send(&mut sender, 0..500);
    drop(sender);
    let mut got = 0;
    let deadline = Instant::now() + LONG;
    while got < 500 && Instant::now() < deadline {
        let tick = Duration::from_millis(20);
        let received = receiver.receive(tick, &mut |_| got += 1).unwrap();
        assert_ne!(received, Received::End);
    }
    assert_eq!((got, receiver.counts().lost), (500, 0));
}
