//! One function per guarantee, over any transport.

use super::{
    Audience, Duration, Instant, JointState, Keep, LONG, LinkError, Received, Receiver, STREAM,
    Sender, Sides, Transport, TwinState, next, send, take, take_to_end,
};

/// Polls the receivers until the sender is connected to all of them.
fn meet(sender: &mut dyn Sender<JointState>, receivers: &mut [&mut Box<dyn Receiver<JointState>>]) {
    let deadline = Instant::now() + LONG;
    while sender.wait_for_receivers(Duration::from_millis(5)).unwrap() > 0 {
        assert!(Instant::now() < deadline, "they do not meet");
        for receiver in &mut *receivers {
            let received = receiver.receive(Duration::ZERO, &mut |_| {}).unwrap();
            assert_eq!(received, Received::Nothing, "the stream has not begun");
        }
    }
}

/// Waits until the sender reports `missing` receivers as missing.
fn missing_becomes(sender: &mut dyn Sender<JointState>, missing: usize) {
    let deadline = Instant::now() + LONG;
    loop {
        let found = sender.wait_for_receivers(Duration::from_millis(5)).unwrap();
        if found == missing {
            return;
        }
        assert!(
            Instant::now() < deadline,
            "{found} are missing, not {missing}"
        );
    }
}

fn audience(keep_all: usize, keep_newest: usize) -> Audience {
    Audience {
        keep_all,
        keep_newest,
    }
}

pub fn order_is_kept<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides
        .sending()
        .sender::<JointState>(STREAM, audience(1, 0))
        .unwrap();
    meet(&mut *sender, &mut [&mut receiver]);
    let heard = std::thread::scope(|scope| {
        let heard = scope.spawn(|| take_to_end(&mut *receiver));
        send(&mut *sender, 0, 5_000);
        sender.end().unwrap();
        heard.join().unwrap()
    });
    assert!(heard.iter().copied().eq(0..5_000), "{} came", heard.len());
    assert_eq!(
        (receiver.counts().received, receiver.counts().lost),
        (5_000, 0)
    );
    assert_eq!(
        (sender.counts().sent, sender.counts().undelivered),
        (5_000, 0)
    );
    assert_eq!(receiver.position().unwrap().next, 5_001);
}

pub fn late_joiner_hears_the_rest<S: Sides>() {
    let sides = S::new(LONG);
    let mut early = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(2, 0)).unwrap();
    early.receive(Duration::ZERO, &mut |_| {}).unwrap();
    missing_becomes(&mut *sender, 1);
    send(&mut *sender, 0, 5);
    // No sample may be in transit when the late receiver connects.
    assert_eq!(take(&mut *early, 5), [0, 1, 2, 3, 4]);
    let mut late = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    meet(&mut *sender, &mut [&mut late]);
    send(&mut *sender, 5, 5);
    assert_eq!(take(&mut *late, 5), [5, 6, 7, 8, 9]);
    assert_eq!(late.counts().lost, 0, "it was not there");
    assert_eq!(sender.counts().undelivered, 5, "but it was expected");
    assert_eq!(take(&mut *early, 5), [5, 6, 7, 8, 9]);
}

pub fn slow_reader_that_keeps_all_loses_nothing<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 4).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(1, 0)).unwrap();
    meet(&mut *sender, &mut [&mut receiver]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            send(&mut *sender, 0, 200);
            sender.end().unwrap();
        });
        for number in 0..200 {
            if number % 20 == 0 {
                std::thread::sleep(Duration::from_millis(5));
            }
            assert_eq!(next(&mut *receiver), Some(number));
        }
        assert_eq!(next(&mut *receiver), None);
    });
    assert_eq!(receiver.counts().lost, 0);
    assert_eq!(sender.counts().undelivered, 0);
}

/// Two receivers on one stream: the end at the keep-all receiver shows that all samples have arrived.
pub fn slow_reader_that_keeps_the_newest_loses_the_oldest<S: Sides>() {
    let sides = S::new(LONG);
    let mut all = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut newest = sides.receiving().receiver(STREAM, Keep::Newest, 4).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(1, 1)).unwrap();
    meet(&mut *sender, &mut [&mut all, &mut newest]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            send(&mut *sender, 0, 500);
            sender.end().unwrap();
        });
        assert_eq!(take_to_end(&mut *all), (0..500).collect::<Vec<_>>());
    });
    let heard = take_to_end(&mut *newest);
    let from = 500 - heard.len() as i64;
    assert!((1..=4).contains(&heard.len()), "{heard:?}");
    assert_eq!(heard, (from..500).collect::<Vec<_>>());
    assert_eq!(newest.counts().dropped(), from as u64);
    assert_eq!(all.counts().lost, 0);
    assert_eq!(
        (sender.counts().sent, sender.counts().undelivered),
        (500, 0)
    );
}

pub fn stuck_reader_is_given_up_and_counted<S: Sides>() {
    let sides = S::new(Duration::from_millis(200));
    let mut stuck = sides.receiving().receiver(STREAM, Keep::All, 4).unwrap();
    let mut other = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(2, 0)).unwrap();
    meet(&mut *sender, &mut [&mut stuck, &mut other]);
    let begin = Instant::now();
    send(&mut *sender, 0, 50);
    assert_eq!(take(&mut *other, 50), (0..50).collect::<Vec<_>>());
    assert!(begin.elapsed() < LONG / 2, "patience is used up once");
    // The hung receiver recovers: it gets the samples kept for it, and then the new ones.
    let mut heard = take(&mut *stuck, 4);
    assert_eq!(heard, [0, 1, 2, 3]);
    send(&mut *sender, 50, 2);
    sender.end().unwrap();
    heard.extend(take_to_end(&mut *stuck));
    assert_eq!(heard.last(), Some(&51));
    let missed = 52 - heard.len() as u64;
    assert_eq!(missed == 0, S::REMEMBERS, "{missed}");
    assert_eq!(stuck.counts().lost, missed);
    assert_eq!(take_to_end(&mut *other), [50, 51]);
    assert_eq!(other.counts().lost, 0);
    assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    assert_eq!(sender.counts().undelivered, missed);
}

pub fn receiver_gone_and_back<S: Sides>() {
    let sides = S::new(LONG);
    let mut stays = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut goes = sides.receiving().receiver(STREAM, Keep::All, 1).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(2, 0)).unwrap();
    meet(&mut *sender, &mut [&mut stays, &mut goes]);
    send(&mut *sender, 0, 1);
    assert_eq!(take(&mut *goes, 1), [0]);
    drop(goes);
    // Its queue would be full with one unread sample, and would block a sender that waits for it.
    let begin = Instant::now();
    send(&mut *sender, 1, 3);
    assert!(begin.elapsed() < LONG);
    // No sample may be in transit when the receiver reconnects.
    assert_eq!(take(&mut *stays, 4), [0, 1, 2, 3]);
    missing_becomes(&mut *sender, 1);
    let mut back = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    meet(&mut *sender, &mut [&mut back]);
    send(&mut *sender, 4, 3);
    assert_eq!(take(&mut *back, 3), [4, 5, 6]);
    assert_eq!(take(&mut *stays, 3), [4, 5, 6]);
    assert_eq!((back.counts().lost, stays.counts().lost), (0, 0));
}

pub fn sender_gone_and_back<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    for life in 0..3 {
        let mut sender = sides.sending().sender(STREAM, audience(1, 0)).unwrap();
        meet(&mut *sender, &mut [&mut receiver]);
        send(&mut *sender, life * 10, 10);
        let expected: Vec<_> = (life * 10..life * 10 + 10).collect();
        assert_eq!(take(&mut *receiver, 10), expected);
    }
    assert_eq!(
        (receiver.counts().received, receiver.counts().lost),
        (30, 0)
    );
}

pub fn end_comes_last_and_once<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    for _life in 0..2 {
        let mut sender = sides.sending().sender(STREAM, audience(1, 0)).unwrap();
        meet(&mut *sender, &mut [&mut receiver]);
        send(&mut *sender, 0, 3);
        sender.end().unwrap();
        assert_eq!(take_to_end(&mut *receiver), [0, 1, 2]);
        assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    }
    assert_eq!((receiver.counts().received, receiver.counts().lost), (6, 0));
}

pub fn end_is_waited_for<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(1, 0)).unwrap();
    meet(&mut *sender, &mut [&mut receiver]);
    send(&mut *sender, 0, 3);
    sender.end().unwrap();
    assert_eq!(
        sender.wait_until_taken(Duration::from_millis(50)).unwrap(),
        1
    );
    std::thread::scope(|scope| {
        scope.spawn(|| assert_eq!(take_to_end(&mut *receiver), [0, 1, 2]));
        assert_eq!(sender.wait_until_taken(LONG).unwrap(), 0);
    });
}

pub fn missing_receivers_are_told<S: Sides>() {
    let sides = S::new(LONG);
    let mut all = sides
        .receiving()
        .receiver::<JointState>(STREAM, Keep::All, 4)
        .unwrap();
    let mut sender = sides
        .sending()
        .sender::<JointState>(STREAM, audience(2, 1))
        .unwrap();
    all.receive(Duration::ZERO, &mut |_| {}).unwrap();
    missing_becomes(&mut *sender, 2);
    let _newest = sides
        .receiving()
        .receiver::<JointState>(STREAM, Keep::Newest, 4)
        .unwrap();
    missing_becomes(&mut *sender, 1);
    let _other = sides
        .receiving()
        .receiver::<JointState>(STREAM, Keep::All, 4)
        .unwrap();
    missing_becomes(&mut *sender, 0);
}

/// Refusal when the link is opened or, if the type is not known yet, with the first sample.
pub fn another_type_is_refused<S: Sides>() {
    let sides = S::new(LONG);
    let mut sender = sides
        .sending()
        .sender::<JointState>(STREAM, audience(1, 0))
        .unwrap();
    let mut receiver = match sides
        .receiving()
        .receiver::<TwinState>(STREAM, Keep::All, 8)
    {
        Ok(receiver) => receiver,
        Err(LinkError::TypeMismatch {
            stream,
            expected,
            found,
        }) => {
            assert_eq!(stream, STREAM);
            assert!(expected.contains("tauscope/TwinState/1"), "{expected}");
            assert!(found.contains("tauscope/JointState/2"), "{found}");
            return;
        }
        Err(other) => panic!("{other}"),
    };
    sender.wait_for_receivers(LONG).unwrap();
    send(&mut *sender, 0, 1);
    let deadline = Instant::now() + LONG;
    while receiver.counts().refused == 0 {
        assert!(Instant::now() < deadline, "it is not counted");
        let received = receiver.receive(Duration::from_millis(10), &mut |_| panic!("it is heard"));
        assert_eq!(received.unwrap(), Received::Nothing);
    }
}

/// Invalid samples of a faulty sender are refused at the receiving end, and valid ones are accepted.
pub fn what_no_stage_may_see_is_refused_and_counted<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides
        .sending()
        .sender::<JointState>(STREAM, audience(1, 0))
        .unwrap();
    meet(&mut *sender, &mut [&mut receiver]);
    send(&mut *sender, 0, 1);
    let wrongs: [fn(&mut JointState); 4] = [
        |sample| sample.header.joint_count = 4_000_000_000,
        |sample| sample.effort[2] = f64::NAN,
        |sample| sample.position[15] = f64::INFINITY,
        |sample| sample.header.stamp_ns = i64::MAX,
    ];
    for wrong in wrongs {
        sender.send_with(&mut |sample| wrong(sample)).unwrap();
    }
    send(&mut *sender, 1, 1);
    sender.end().unwrap();
    assert_eq!(take_to_end(&mut *receiver), [0, 1]);
    let counts = receiver.counts();
    assert_eq!((counts.received, counts.refused, counts.lost), (2, 4, 0));
}

/// A receiver knows the number of samples sent before it connected, so that its counters match the sender's.
pub fn what_a_late_joiner_missed_is_known<S: Sides>() {
    let sides = S::new(LONG);
    let mut early = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides.sending().sender(STREAM, audience(2, 0)).unwrap();
    early.receive(Duration::ZERO, &mut |_| {}).unwrap();
    missing_becomes(&mut *sender, 1);
    send(&mut *sender, 0, 5);
    // No sample may be in transit when the late receiver connects.
    assert_eq!(take(&mut *early, 5), [0, 1, 2, 3, 4]);
    let mut late = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    meet(&mut *sender, &mut [&mut late]);
    send(&mut *sender, 5, 2);
    sender.end().unwrap();
    take_to_end(&mut *late);
    take_to_end(&mut *early);
    for receiver in [&late, &early] {
        let counts = receiver.counts();
        assert_eq!(sender.counts().sent, counts.received + counts.dropped());
    }
    assert_eq!((late.counts().before, late.counts().lost), (5, 0));
}

/// A crashed receiver that resumes counts the samples sent in between.
pub fn loss_over_a_restart_of_the_receiver_is_counted<S: Sides>() {
    let sides = S::new(LONG);
    let open = || {
        sides
            .receiving()
            .receiver::<JointState>(STREAM, Keep::All, 64)
            .unwrap()
    };
    let mut first = open();
    let mut sender = sides.sending().sender(STREAM, audience(1, 0)).unwrap();
    meet(&mut *sender, &mut [&mut first]);
    send(&mut *sender, 0, 10);
    take(&mut *first, 4);
    let position = first.position().unwrap();
    assert_eq!(position.next, 4);
    drop(first);
    send(&mut *sender, 10, 10);
    missing_becomes(&mut *sender, 1);
    let mut second = open();
    second.resume(position);
    assert_eq!(sender.wait_for_receivers(LONG).unwrap(), 0);
    send(&mut *sender, 20, 1);
    // Over a network it may still receive samples that were in transit.
    let heard: Vec<_> = std::iter::from_fn(|| next(&mut *second))
        .take_while(|&stamp| stamp < 20)
        .collect();
    assert_eq!(second.counts().lost, 16 - heard.len() as u64);
    assert_eq!(second.counts().received, 1 + heard.len() as u64);
}

pub fn what_is_skipped_is_lost<S: Sides>() {
    let sides = S::new(LONG);
    let mut receiver = sides.receiving().receiver(STREAM, Keep::All, 64).unwrap();
    let mut sender = sides
        .sending()
        .sender::<JointState>(STREAM, audience(1, 0))
        .unwrap();
    meet(&mut *sender, &mut [&mut receiver]);
    send(&mut *sender, 0, 10);
    sender.skip(7);
    send(&mut *sender, 10, 10);
    sender.skip(3);
    sender.end().unwrap();
    let heard = take_to_end(&mut *receiver);
    assert!(heard.into_iter().eq(0..20));
    assert_eq!(
        (receiver.counts().received, receiver.counts().lost),
        (20, 10)
    );
}
