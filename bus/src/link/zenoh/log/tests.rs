use super::*;

const PATIENCE: Duration = Duration::from_secs(5);

fn log(readers: usize, most: usize) -> Log<u64> {
    Log::new(Keep::All, Audience::of(Keep::All, readers), most, PATIENCE)
}

fn push(log: &mut Log<u64>, numbers: std::ops::Range<u64>) {
    numbers.for_each(|number| log.push(number));
}

fn out(log: &mut Log<u64>, now: Instant) -> Vec<u64> {
    let mut all = Vec::new();
    while let Some(batch) = log.batch(8, now) {
        all.extend(batch.samples);
    }
    all
}

#[test]
fn no_more_goes_out_than_there_is_room_for() {
    let now = Instant::now();
    let mut log = log(1, 100);
    log.join("a", 4, now);
    push(&mut log, 0..10);
    assert_eq!(out(&mut log, now), [0, 1, 2, 3]);
    log.taken("a", (3, 0), false, now);
    assert_eq!(out(&mut log, now), [4, 5, 6]);
}

#[test]
fn what_did_not_arrive_goes_out_again() {
    let now = Instant::now();
    let mut log = log(1, 100);
    log.join("a", 64, now);
    push(&mut log, 0..10);
    assert_eq!(out(&mut log, now).len(), 10);
    log.taken("a", (4, 0), true, now);
    assert_eq!(out(&mut log, now), [4, 5, 6, 7, 8, 9]);
    // The last samples are not acknowledged.
    log.look_back(now + AGAIN_AFTER / 2);
    assert!(out(&mut log, now).is_empty());
    log.look_back(now + AGAIN_AFTER);
    assert_eq!(out(&mut log, now), [4, 5, 6, 7, 8, 9]);
}

#[test]
fn one_that_was_cut_off_finds_all_that_was_sent_meanwhile() {
    let now = Instant::now();
    let mut log = log(1, 100);
    log.join("a", 64, now);
    push(&mut log, 0..5);
    assert_eq!(out(&mut log, now), [0, 1, 2, 3, 4]);
    log.taken("a", (3, 0), false, now);
    log.lose("a", now);
    push(&mut log, 5..50);
    assert_eq!((out(&mut log, now), log.missing()), (Vec::new(), 1));
    log.join("a", 64, now);
    assert!(out(&mut log, now).into_iter().eq(3..50));
    assert_eq!(log.undelivered(), 0);
}

#[test]
fn one_that_comes_for_a_dead_one_goes_on_where_that_was() {
    let now = Instant::now();
    let mut log = log(1, 100);
    log.join("a", 64, now);
    push(&mut log, 0..5);
    out(&mut log, now);
    log.taken("a", (2, 0), false, now);
    log.lose("a", now);
    log.join("b", 64, now);
    log.taken("b", (2, 0), false, now);
    assert_eq!(out(&mut log, now), [2, 3, 4]);
    // A receiver that disconnected normally leaves no position to resume at.
    log.leave("b");
    push(&mut log, 5..7);
    log.join("c", 64, now);
    log.taken("c", (7, 0), false, now);
    push(&mut log, 7..8);
    assert_eq!(out(&mut log, now).last(), Some(&7));
}

#[test]
fn what_has_no_room_is_a_gap_and_counted_for_those_without_it() {
    let now = Instant::now();
    let mut log = log(2, 10);
    for id in ["a", "b"] {
        log.join(id, 64, now);
    }
    push(&mut log, 0..4);
    assert_eq!(out(&mut log, now).len(), 4);
    log.taken("a", (4, 0), false, now);
    log.lose("b", now);
    push(&mut log, 4..20);
    let batch = log.batch(64, now).unwrap();
    assert_eq!((batch.since, batch.gap, batch.samples.len()), (10, 10, 10));
    log.taken("a", (20, 6), false, now);
    assert_eq!(log.undelivered(), 6, "as it says");
    log.abandon();
    assert_eq!(log.undelivered(), 26, "the other has got none");
}

#[test]
fn a_frozen_one_holds_up_the_others_only_for_the_patience() {
    let now = Instant::now();
    let mut log = log(2, 100);
    for id in ["a", "b"] {
        log.join(id, 4, now);
    }
    push(&mut log, 0..20);
    assert_eq!(out(&mut log, now).len(), 4);
    log.taken("a", (4, 0), false, now);
    assert!(out(&mut log, now).is_empty());
    assert_eq!(out(&mut log, now + PATIENCE), [4, 5, 6, 7]);
    // The hung receiver recovers.
    log.taken("b", (4, 0), false, now + PATIENCE);
    log.taken("b", (4, 0), true, now + PATIENCE);
    assert_eq!(out(&mut log, now + PATIENCE), [4, 5, 6, 7]);
    assert_eq!(log.undelivered(), 0);
}

#[test]
fn the_end_goes_out_until_it_is_taken() {
    for keep in [Keep::All, Keep::Newest] {
        let now = Instant::now();
        let mut log = Log::new(keep, Audience::of(keep, 1), 10, PATIENCE);
        log.join("a", 64, now);
        push(&mut log, 0..3);
        log.push_end(99, now);
        assert_eq!(out(&mut log, now), [0, 1, 2, 99]);
        assert_eq!(log.untaken(), 1);
        log.look_back(now + AGAIN_AFTER);
        assert_eq!(out(&mut log, now).last(), Some(&99), "{keep:?}");
        log.taken("a", (4, 0), false, now);
        assert_eq!((log.untaken(), log.is_empty()), (0, true), "{keep:?}");
    }
}

/// A recorder that had 12 s of samples to catch up with after a network failure was given up on after 10 s, and then
/// waited for the rest forever.
#[test]
fn a_receiver_that_makes_progress_is_awaited_however_long_it_takes() {
    let begin = Instant::now();
    let mut log = log(1, 100);
    log.join("a", 64, begin);
    push(&mut log, 0..20);
    log.push_end(99, begin);
    assert_eq!(out(&mut log, begin).len(), 21);
    let mut now = begin;
    for next in 1..=20 {
        now += PATIENCE / 2;
        log.taken("a", (next, 0), false, now);
        assert!(log.is_awaited(now, PATIENCE));
    }
    assert!(!log.is_awaited(now + PATIENCE, PATIENCE), "stalled");
    assert_eq!(log.untaken(), 1);
    log.taken("a", (21, 0), false, now);
    assert!(!log.is_awaited(now, PATIENCE), "all taken");
}

#[test]
fn those_who_keep_the_newest_are_never_waited_for() {
    let now = Instant::now();
    let mut log = Log::new(Keep::Newest, Audience::of(Keep::Newest, 1), 4, PATIENCE);
    log.join("a", 64, now);
    for number in 0..100 {
        log.push(number);
        assert_eq!(out(&mut log, now), [number]);
    }
    assert!(log.is_empty());
    push(&mut log, 100..120);
    assert!(!log.is_full(now));
    assert_eq!(out(&mut log, now), [116, 117, 118, 119]);
    assert_eq!(log.undelivered(), 0);
}
