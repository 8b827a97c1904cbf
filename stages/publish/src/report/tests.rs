use tauscope_bus::command::{Request, Signed};
use tauscope_bus::{Detection, TwinState, flags};

use super::*;

const S: i64 = 1_000_000_000;

fn report() -> Report {
    Report::new(vec!["a".to_owned(), "b".to_owned()], 2)
}

fn detection(t: i64, event: u32, alarm: bool) -> Detection {
    let mut detection = Detection {
        state: if alarm { "collision" } else { "free" }.into(),
        link: if alarm { "link5" } else { "" }.into(),
        score: 9.0,
        threshold: 1.0,
        event,
        contact_ns: t - 5,
        force_n: [0.0, 24.0, 0.0],
        ..Detection::default()
    };
    detection.header.stamp_ns = t;
    detection.header.flags = flags::READY
        | if alarm {
            flags::ALARM | flags::FORCE
        } else {
            0
        };
    detection
}

#[test]
fn a_contact_is_told_when_it_begins_is_latched_ends_and_is_acknowledged_and_by_whom() {
    let mut report = report();
    let told = |report: &mut Report| -> Vec<ContactMessage> {
        let news = report.news().into_iter().map(|record| match record {
            Record::Contact(contact) => contact,
            Record::Change(change) => panic!("{change:?}"),
        });
        news.collect()
    };
    report.detection(0, "d", &detection(S, 0, false), true, State::Free);
    assert!(told(&mut report).is_empty());
    report.detection(
        0,
        "d",
        &detection(2 * S, Detection::ONSET, true),
        true,
        State::Collision,
    );
    let news = told(&mut report);
    assert_eq!(
        (news[0].number, news[0].begin_ns, news[0].end_ns),
        (1, 2 * S - 5, None)
    );
    assert!(!news[0].latched && news[1].latched);
    assert_eq!(news[1].link.as_deref(), Some("link5"));
    assert_eq!(news[1].peak_force_n, Some(24.0));
    report.detection(
        0,
        "d",
        &detection(3 * S, Detection::OFFSET, false),
        true,
        State::Collision,
    );
    assert_eq!(told(&mut report)[0].end_ns, Some(3 * S));
    let by = Some("anna".to_owned());
    let request = Request::Acknowledge;
    report.command(
        4 * S,
        &Signed {
            request,
            by: by.clone(),
        }
        .command()
        .unwrap(),
    );
    let news = told(&mut report);
    assert_eq!(
        (news[0].acknowledged_ns, &news[0].acknowledged_by),
        (Some(4 * S), &by)
    );
    // The contact is acknowledged already: another acknowledgement has no effect.
    report.command(5 * S, &Request::Acknowledge.command().unwrap());
    assert!(told(&mut report).is_empty());
    assert_eq!(report.last().unwrap().acknowledged_by, by);
}

#[test]
fn two_detectors_that_see_one_contact_make_one() {
    let mut report = report();
    report.detection(
        0,
        "d",
        &detection(S, Detection::ONSET, true),
        true,
        State::Contact,
    );
    report.detection(
        1,
        "e",
        &detection(S, Detection::ONSET, true),
        true,
        State::Contact,
    );
    report.detection(
        1,
        "e",
        &detection(2 * S, Detection::OFFSET, false),
        true,
        State::Contact,
    );
    assert_eq!(report.last().unwrap().end_ns, None);
    report.detection(
        0,
        "d",
        &detection(2 * S, Detection::OFFSET, false),
        true,
        State::Free,
    );
    assert_eq!(report.today(), (1, S));
    assert_eq!(report.last().unwrap().detector, "d");
    assert_eq!(report.last().unwrap().end_ns, Some(2 * S));
}

#[test]
fn contacts_are_counted_anew_at_midnight() {
    let mut report = report();
    report.detection(
        0,
        "d",
        &detection(5 * S, Detection::ONSET, true),
        true,
        State::Contact,
    );
    report.detection(
        0,
        "d",
        &detection(6 * S, Detection::OFFSET, false),
        true,
        State::Free,
    );
    assert_eq!(report.today(), (1, 5 * S));
    report.detection(0, "d", &detection(DAY_NS + S, 0, false), true, State::Free);
    assert_eq!(report.today(), (0, DAY_NS));
}

#[test]
fn a_change_of_the_arm_is_told_once_and_stands_until_it_is_learned() {
    let mut report = report();
    let mut change = detection(S, Detection::ONSET, true);
    change.state = "payload".into();
    change.header.flags |= flags::CHANGE;
    change.joints = 0b10;
    change.size = 2.1;
    report.detection(1, "w", &change, false, State::Free);
    change.event = 0;
    report.detection(1, "w", &change, false, State::Free);
    let news = report.news();
    let [Record::Change(told)] = news.as_slice() else {
        panic!("{news:?}");
    };
    assert_eq!((told.effect.as_str(), told.size), ("payload", 2.1));
    assert_eq!(told.joints, ["b"]);
    assert_eq!(report.changes().len(), 1);
    report.detection(
        1,
        "w",
        &detection(3 * S, Detection::OFFSET, false),
        false,
        State::Free,
    );
    assert!(report.changes().is_empty() && report.last().is_none());
}

#[test]
fn the_residual_is_that_of_the_last_minute() {
    let mut residual = Residual::new(vec!["a".to_owned()], vec![Some(0.5)]);
    assert_eq!(residual.message(), None);
    for i in 0..1200 {
        let mut sample = TwinState::default();
        sample.header.stamp_ns = i * S / 10;
        sample.header.flags = flags::READY;
        // Two minutes; in the second one the residual oscillates about 1.
        sample.residual[0] = if i < 600 {
            50.0
        } else {
            1.0 + [2.0, -2.0][(i % 2) as usize]
        };
        residual.twin(&sample);
    }
    let message = residual.message().unwrap();
    assert!((message.joints[0].mean - 1.0).abs() < 1e-9, "{message:?}");
    assert!(
        (message.joints[0].rms - 5f64.sqrt()).abs() < 1e-9,
        "{message:?}"
    );
    assert!((message.window_s - 54.0).abs() < 1e-6, "{message:?}");
    assert_eq!(message.joints[0].calibrated, Some(0.5));
}

#[test]
fn what_is_around_a_contact_says_nothing_of_the_arm() {
    let mut residual = Residual::new(vec!["a".to_owned()], vec![None]);
    for i in 0..300 {
        let mut sample = TwinState::default();
        sample.header.stamp_ns = i * S / 10;
        sample.header.flags = flags::READY;
        // A push from 10 s to 12 s, detected from 10.5 s to 12 s; the arm oscillates until 12.5 s.
        sample.residual[0] = if (100..125).contains(&i) { 9.0 } else { 1.0 };
        residual.twin(&sample);
        if (105..=120).contains(&i) {
            residual.touched(sample.header.stamp_ns);
        }
    }
    let message = residual.message().unwrap();
    assert!((message.joints[0].rms - 1.0).abs() < 1e-9, "{message:?}");
    assert!(message.window_s > 20.0, "{message:?}");
}
