use super::*;
use crate::fixture;
use crate::wall::{Remembered, Severity};

const MIN: i64 = 60_000_000_000;
const DAY: i64 = 1440 * MIN;

fn store() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(&folder.path().join("fleet.sqlite")).unwrap();
    (folder, store)
}

fn news(place: &str, at_min: i64, severity: Severity) -> News {
    News {
        cell: "a".to_owned(),
        kind: Kind::Contact,
        place: place.to_owned(),
        severity,
        words: format!("contact at {place}"),
        at_ns: at_min * MIN,
    }
}

#[test]
fn a_cause_that_comes_again_within_ten_minutes_is_the_same_incident() {
    let (_folder, store) = store();
    store.raise(&news("link5", 0, Severity::Notice)).unwrap();
    store.raise(&news("link5", 1, Severity::Critical)).unwrap();
    store.raise(&news("link2", 1, Severity::Notice)).unwrap();
    store.close("a", Kind::Contact, "link5", 2 * MIN).unwrap();
    store.acknowledge("a", "anna", 3 * MIN).unwrap();
    store.raise(&news("link5", 11, Severity::Notice)).unwrap();
    let all = store.incidents(None, 10).unwrap();
    assert_eq!(all.len(), 2);
    let again = &all[0];
    assert_eq!(
        (again.count, again.reopened, again.severity),
        (3, 1, Severity::Critical)
    );
    assert_eq!(
        (again.opened_ns, again.closed_ns, &again.acknowledged_by),
        (0, None, &None)
    );
    store.close("a", Kind::Contact, "link5", 12 * MIN).unwrap();
    store.raise(&news("link5", 23, Severity::Notice)).unwrap();
    assert_eq!(store.incidents(Some("a"), 10).unwrap().len(), 3);
    assert_eq!(store.incidents(Some("b"), 10).unwrap(), []);
}

#[test]
fn a_cause_that_is_told_with_a_stamp_of_long_before_its_end_is_another_incident() {
    let (_folder, store) = store();
    store.raise(&news("link5", 600, Severity::Notice)).unwrap();
    store.close("a", Kind::Contact, "link5", 601 * MIN).unwrap();
    store.raise(&news("link5", 60, Severity::Notice)).unwrap();
    // The open incident is continued, whatever its stamps.
    store.raise(&news("link5", 61, Severity::Notice)).unwrap();
    let all = store.incidents(None, 10).unwrap();
    let counts: Vec<_> = all.iter().map(|one| (one.count, one.reopened)).collect();
    assert_eq!(counts, [(2, 0), (1, 0)]);
}

#[test]
fn a_contact_that_lasts_when_its_run_ends_is_over_unless_it_is_latched() {
    let (_folder, store) = store();
    store.raise(&news("link5", 0, Severity::Notice)).unwrap();
    store.raise(&news("link2", 0, Severity::Critical)).unwrap();
    store.run_ended("b", MIN).unwrap();
    store.run_ended("a", MIN).unwrap();
    let all = store.incidents(None, 10).unwrap();
    let of = |place: &str| all.iter().find(|one| one.words.contains(place)).unwrap();
    assert_eq!(of("link5").closed_ns, Some(MIN));
    assert_eq!(
        of("link5").words,
        "contact at link5; it lasted when the run ended"
    );
    assert_eq!(of("link2").closed_ns, None);
}

#[test]
fn a_contact_is_kept_once_with_all_that_becomes_known_of_it() {
    let (_folder, store) = store();
    let mut contact = fixture::contact(1, 5);
    let keep = |contact: &_| store.contact("a", "x", contact, "pc", None, 0).unwrap();
    assert_eq!(keep(&contact), Said::New);
    let begun = contact.clone();
    contact.end_ns = Some(6_000_000_000);
    contact.acknowledged_by = Some("anna".to_owned());
    assert_eq!(keep(&contact), Said::More);
    // A repeated message adds nothing, and takes nothing back.
    assert_eq!(keep(&contact), Said::Nothing);
    assert_eq!(keep(&begun), Said::Nothing);
    // Of another publisher instance it is another contact.
    let other = fixture::contact(1, 9);
    let said = store.contact("a", "y", &other, "pc", Some("a.mcap"), 0);
    assert_eq!(said.unwrap(), Said::New);
    let kept = store.contacts("a", 10).unwrap();
    assert_eq!(kept.len(), 2);
    assert_eq!(kept[0].archive.as_deref(), Some("a.mcap"));
    assert_eq!(kept[1].contact, contact);
}

#[test]
fn normal_is_the_first_day_behind_the_newest_baseline() {
    let (_folder, store) = store();
    let add = |day: i64, rms: f64, minutes: i64| {
        for minute in 0..minutes {
            store
                .minute("a", "j", day * DAY + minute * MIN, rms, 0.1)
                .unwrap();
        }
    };
    add(0, 1.0, 59);
    assert_eq!(store.normals("a").unwrap(), []);
    add(1, 1.0, 1400);
    add(9, 3.0, 120);
    let normal = |store: &Store| store.normals("a").unwrap()[0].rms;
    assert!((normal(&store) - 1.0).abs() < 1e-9);
    let note = Note {
        at_ns: 8 * DAY,
        by: "anna".to_owned(),
        text: "new gear".to_owned(),
        baseline: true,
    };
    store.note("a", &note).unwrap();
    assert!((normal(&store) - 3.0).abs() < 1e-9);
    assert_eq!(store.notes("a", 5).unwrap(), [note]);
    let days = store.days("a", 0).unwrap();
    assert_eq!(days.len(), 3);
    assert!(
        (days[2].rms - 3.0).abs() < 1e-9 && days[2].minutes == 120,
        "{days:?}"
    );
}

#[test]
fn what_is_old_goes_and_the_file_is_read_again() {
    let (_folder, store) = store();
    store.seen("a", 5, "pc", "arm").unwrap();
    store.seen("b", KEPT_NS, "pc", "arm").unwrap();
    store.raise(&news("link5", 0, Severity::Notice)).unwrap();
    store.prune(KEPT_NS + 10).unwrap();
    let again = store.again().unwrap();
    let b = Remembered {
        cell: "b".to_owned(),
        seen_ns: KEPT_NS,
        ended_ns: None,
    };
    assert_eq!(again.cells().unwrap(), [b]);
    assert_eq!(again.incidents(None, 5).unwrap(), []);
}

#[test]
fn a_contact_is_as_old_as_it_is_by_the_clock_of_the_fleet_host() {
    let (_folder, store) = store();
    let (wrong, old) = (
        fixture::contact(1, 5),
        fixture::contact(2, KEPT_NS / 1_000_000_000),
    );
    let now_ns = KEPT_NS + 10;
    store.contact("a", "x", &wrong, "pc", None, now_ns).unwrap();
    store.contact("a", "x", &old, "pc", None, 9).unwrap();
    store.prune(now_ns).unwrap();
    let kept = store.contacts("a", 9).unwrap();
    assert_eq!(kept.len(), 1);
    assert_eq!(kept[0].contact, wrong);
}

#[test]
fn a_file_that_is_none_of_ours_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("other.db");
    let other = Connection::open(&path).unwrap();
    other.execute_batch("CREATE TABLE t (x)").unwrap();
    let error = Store::open(&path).unwrap_err().to_string();
    assert!(error.contains("has the version 0"), "{error}");
    std::fs::write(
        folder.path().join("text"),
        "no database, but long enough to be one".repeat(50),
    )
    .unwrap();
    assert!(Store::open(&folder.path().join("text")).is_err());
}

#[test]
fn a_label_is_kept_with_the_contact_and_the_incident_that_it_is_about() {
    let (_folder, store) = store();
    let label = |stamp_ns: i64, text: &str| Label {
        at_ns: stamp_ns,
        stamp_ns,
        by: "anna".to_owned(),
        text: text.to_owned(),
    };
    store.label("a", &label(MIN, "before all")).unwrap();
    let contact = fixture::contact(1, 120);
    store.contact("a", "x", &contact, "pc", None, 0).unwrap();
    store.raise(&news("tauscope", 2, Severity::Notice)).unwrap();
    store
        .label("a", &label(3 * MIN, "hit the fixture"))
        .unwrap();
    store.label("a", &label(3 * DAY, "new gripper")).unwrap();
    store
        .label("b", &label(3 * MIN, "of another cell"))
        .unwrap();
    // A later contact does not take over a label.
    let later = fixture::contact(2, 600);
    store.contact("a", "x", &later, "pc", None, 0).unwrap();
    let kept = store.labels(Some("a"), 10).unwrap();
    let about = |text: &str| {
        let one = kept.iter().find(|one| one.label.text == text).unwrap();
        (one.onset_ns, one.incident)
    };
    assert_eq!(kept.len(), 3);
    let incident = store.incidents(Some("a"), 10).unwrap()[0].id;
    let own = (Some(contact.onset_ns), Some(incident));
    assert_eq!(about("hit the fixture"), own);
    assert_eq!(about("before all"), (None, None));
    assert_eq!(about("new gripper"), (None, None));
    assert_eq!(kept[0].label.by, "anna");
    store.prune(KEPT_NS + 2 * DAY).unwrap();
    assert_eq!(store.labels(Some("a"), 10).unwrap().len(), 1);
}

#[test]
fn a_file_of_before_gets_the_tables_that_it_lacks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fleet.sqlite");
    let store = Store::open(&path).unwrap();
    store
        .connection
        .execute_batch(
            "DROP TABLE labels; DROP TABLE heard; DROP TABLE ended; DROP TABLE arrivals; DROP TABLE believed;",
        )
        .unwrap();
    drop(store);
    let again = Store::open(&path).unwrap();
    assert_eq!(again.labels(None, 1).unwrap(), []);
    assert_eq!(again.cells().unwrap(), []);
    assert_eq!(again.believed_ns().unwrap(), None);
    assert!(again.hear("a", "x", 1, 0).unwrap());
    assert!(!again.hear("a", "x", 1, 9).unwrap());
}

#[test]
fn a_latch_is_known_until_it_is_acknowledged() {
    let (_folder, store) = store();
    let mut contact = fixture::contact(1, 60);
    contact.latched = true;
    store.contact("a", "x", &contact, "pc", None, 0).unwrap();
    store
        .raise(&news("tauscope", 1, Severity::Critical))
        .unwrap();
    let latched = Some(("x".to_owned(), MIN));
    assert_eq!(store.latched("a").unwrap(), latched);
    assert_eq!(store.latched("b").unwrap(), None);
    contact.acknowledged_ns = Some(2 * MIN);
    store.contact("a", "x", &contact, "pc", None, 0).unwrap();
    assert_eq!(store.latched("a").unwrap(), None);
    // A later contact that is not latched.
    store
        .contact("a", "x", &fixture::contact(2, 120), "pc", None, 0)
        .unwrap();
    assert_eq!(store.latched("a").unwrap(), None);
}
