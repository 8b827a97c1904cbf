use super::*;
use crate::fixture;
use crate::wall::Severity;

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
fn a_contact_is_kept_once_with_all_that_becomes_known_of_it() {
    let (_folder, store) = store();
    let mut contact = fixture::contact(1, 5);
    assert!(store.contact("a", "x", &contact, "pc", None).unwrap());
    contact.end_ns = Some(6_000_000_000);
    contact.acknowledged_by = Some("anna".to_owned());
    assert!(!store.contact("a", "x", &contact, "pc", None).unwrap());
    // Of another life it is another one.
    assert!(
        store
            .contact("a", "y", &fixture::contact(1, 9), "pc", Some("a.mcap"))
            .unwrap()
    );
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
    assert_eq!(again.cells().unwrap(), [("b".to_owned(), KEPT_NS)]);
    assert_eq!(again.incidents(None, 5).unwrap(), []);
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
