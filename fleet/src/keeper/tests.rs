//! Tests of the keeper.

use std::path::PathBuf;

use rusqlite::Connection;
use tauscope_publish::message::{ContactMessage, Record};

use super::*;
use crate::fixture;
use crate::store::Incident;
use crate::wall::StaleWhy;

const SECOND: i64 = 1_000_000_000;

/// A keeper that stores the wall's effects for the cell `a`.
struct Story {
    _folder: tempfile::TempDir,
    path: PathBuf,
    keeper: Keeper,
    wall: Wall,
    now_ns: i64,
}

impl Story {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fleet.sqlite");
        Self {
            keeper: Keeper::new(Store::open(&path).unwrap()),
            wall: Wall::new(["a".to_owned()]),
            now_ns: 1_000_000 * SECOND,
            path,
            _folder: folder,
        }
    }

    /// Stores a record that a cell sent under this number.
    fn try_record(&mut self, number: u64, record: Record) -> Result<(), StoreError> {
        self.tell(number, record, self.now_ns)
    }

    fn tell(&mut self, number: u64, record: Record, told_ns: i64) -> Result<(), StoreError> {
        let effect = Effect::Recorded {
            cell: "a".to_owned(),
            instance: "x".to_owned(),
            number,
            told_ns,
            record: Box::new(record),
        };
        self.keeper.keep(&self.wall, &effect, self.now_ns)
    }

    /// Stores records, numbered from 1 on.
    fn records(&mut self, records: &[Record]) {
        for (number, record) in (1..).zip(records) {
            self.try_record(number, record.clone()).unwrap();
        }
    }

    fn keep(&mut self, effect: &Effect) {
        self.keeper.keep(&self.wall, effect, self.now_ns).unwrap();
    }

    /// The cell's state changes.
    fn change(&mut self, before: State, now: State) {
        let cell = "a".to_owned();
        self.keep(&Effect::Changed { cell, before, now });
    }

    /// The fleet host is started again a minute later.
    fn again(&mut self) {
        self.now_ns += 60 * SECOND;
        self.keeper = Keeper::new(Store::open(&self.path).unwrap());
    }

    fn incidents(&self) -> Vec<Incident> {
        self.keeper.store().incidents(None, 9).unwrap()
    }
}

#[test]
fn a_contact_is_kept_with_its_incident_or_not_at_all() {
    let mut story = Story::new();
    let other = Connection::open(&story.path).unwrap();
    let breaks = "CREATE TRIGGER t BEFORE INSERT ON incidents BEGIN SELECT raise(ABORT, 'no'); END";
    other.execute_batch(breaks).unwrap();
    let contact = ContactMessage {
        latched: true,
        ..fixture::contact(1, 5)
    };
    let record = Record::Contact(contact);
    story.try_record(1, record.clone()).unwrap_err();
    let store = story.keeper.store();
    assert_eq!(store.contacts("a", 9).unwrap(), []);
    other.execute_batch("DROP TRIGGER t").unwrap();
    // The record is stored when it is sent again and the file can be written.
    story.try_record(1, record).unwrap();
    let store = story.keeper.store();
    assert_eq!(store.contacts("a", 9).unwrap().len(), 1);
    assert_eq!(
        store.incidents(None, 9).unwrap()[0].severity,
        Severity::Critical
    );
}

/// Records of a contact that is over and acknowledged, and of one that is latched and not acknowledged.
fn two_contacts() -> Vec<Record> {
    let first = fixture::contact(1, 5);
    let ended = ContactMessage {
        end_ns: Some(6 * SECOND),
        latched: true,
        ..first.clone()
    };
    let seen = ContactMessage {
        acknowledged_ns: Some(7 * SECOND),
        acknowledged_by: Some("anna".to_owned()),
        ..ended.clone()
    };
    let second = ContactMessage {
        latched: true,
        ..fixture::contact(2, 50)
    };
    [first, ended, seen, second].map(Record::Contact).into()
}

#[test]
fn what_a_cell_tells_again_after_a_restart_of_the_fleet_host_changes_no_incident() {
    let mut story = Story::new();
    let mut records = two_contacts();
    records.push(Record::Change(fixture::change()));
    story.records(&records);
    story.now_ns += 60 * SECOND;
    let acknowledged_ns = story.now_ns;
    let store = story.keeper.store();
    store.acknowledge("a", "anna", acknowledged_ns).unwrap();
    records.push(Record::Contact(fixture::contact(3, 90)));
    story.try_record(6, records[5].clone()).unwrap();
    let before = story.incidents();
    let open = before.iter().find(|one| one.kind == "contact").unwrap();
    assert_eq!((open.closed_ns, open.acknowledged_ns), (None, None));
    let change = before.iter().find(|one| one.kind == "change").unwrap();
    assert_eq!((change.count, change.closed_ns), (1, Some(acknowledged_ns)));
    story.again();
    story.records(&records);
    assert_eq!(story.incidents(), before);
}

#[test]
fn an_old_contact_whose_end_is_heard_late_ends_no_incident_of_a_newer_one() {
    let mut story = Story::new();
    let records = two_contacts();
    story.try_record(1, records[0].clone()).unwrap();
    story.again();
    // The newest record arrives first, and the missed ones after it.
    for number in [4, 2, 3] {
        let record = records[number - 1].clone();
        story.try_record(number as u64, record).unwrap();
    }
    let incidents = story.incidents();
    let stands: Vec<_> = incidents
        .iter()
        .map(|one| (one.count, one.closed_ns, one.acknowledged_ns))
        .collect();
    assert_eq!(stands, [(2, None, None)]);
    let contacts = story.keeper.store().contacts("a", 9).unwrap();
    assert_eq!(contacts[1].contact.acknowledged_by.as_deref(), Some("anna"));
}

#[test]
fn a_cell_that_was_lost_while_the_fleet_host_was_down_is_one_incident() {
    let mut story = Story::new();
    let now = State::Stale {
        since_ns: 5,
        why: StaleWhy::Token,
    };
    let cell = "a".to_owned();
    let missing = Effect::Missing { cell, now };
    for _ in 0..3 {
        story.keep(&missing);
        story.again();
    }
    let incidents = story.incidents();
    assert_eq!((incidents.len(), incidents[0].count), (1, 1));
    assert_eq!(incidents[0].kind, "silence");
    // It comes back.
    story.change(now, State::Running);
    assert!(story.incidents()[0].closed_ns.is_some());
}

#[test]
fn a_run_that_ended_in_order_is_known_to_have_ended_until_another_one_begins() {
    let mut story = Story::new();
    let seen = |story: &Story| story.keeper.store().seen("a", 1, "pc", "arm");
    seen(&story).unwrap();
    let ended = |story: &Story| story.keeper.remembered().unwrap()[0].ended_ns;
    let is_over = State::Ended { since_ns: 5 };
    story.change(State::Running, is_over);
    let ended_ns = story.now_ns;
    story.again();
    assert_eq!(ended(&story), Some(ended_ns));
    story.change(is_over, State::Running);
    assert_eq!(ended(&story), None);
}

#[test]
fn a_cell_with_a_wrong_clock_has_its_incidents_at_the_time_of_the_fleet_host() {
    let now_ns = 1_000 * DAY_NS;
    let yesterday_ns = now_ns - DAY_NS;
    for (told_ns, opened_ns) in [
        (now_ns, now_ns),
        // A record that arrives late keeps its own time.
        (yesterday_ns, yesterday_ns),
        (5, now_ns),
        (900 * DAY_NS, now_ns),
        (now_ns + 1, now_ns),
        (5_000 * DAY_NS, now_ns),
    ] {
        let mut story = Story::new();
        story.now_ns = now_ns;
        let record = Record::Change(fixture::change());
        story.tell(1, record, told_ns).unwrap();
        story.keeper.store().prune(now_ns).unwrap();
        assert_eq!(story.incidents()[0].opened_ns, opened_ns, "{told_ns}");
    }
}

#[test]
fn a_clock_that_is_years_ahead_removes_nothing_also_after_a_restart() {
    let mut story = Story::new();
    let snapshot = |story: &Story, now_ns: i64| Snapshot {
        now_ns,
        ..story.wall.snapshot()
    };
    let record = Record::Change(fixture::change());
    story.tell(1, record, story.now_ns).unwrap();
    let right = snapshot(&story, story.now_ns);
    story.keeper.tick(&right).unwrap();
    let wrong = snapshot(&story, story.now_ns + 3_000 * DAY_NS);
    for _ in 0..2 {
        story.keeper.tick(&wrong).unwrap();
        assert_eq!(story.incidents().len(), 1);
        story.again();
    }
}
