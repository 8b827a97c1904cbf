//! What is kept, as statements.

use std::path::PathBuf;

use rusqlite::Connection;
use tauscope_publish::message::{ContactMessage, Record};

use super::*;
use crate::fixture;

const SECOND: i64 = 1_000_000_000;

/// A keeper, and what the wall tells it of the cell `a`.
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

    fn try_record(&mut self, record: Record) -> Result<(), StoreError> {
        let effect = Effect::Recorded {
            cell: "a".to_owned(),
            instance: "x".to_owned(),
            told_ns: self.now_ns,
            record,
        };
        self.keeper.keep(&self.wall, &effect, self.now_ns)
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
    story.try_record(record.clone()).unwrap_err();
    let store = story.keeper.store();
    assert_eq!(store.contacts("a", 9).unwrap(), []);
    other.execute_batch("DROP TRIGGER t").unwrap();
    // It is told again once the file can be written.
    story.try_record(record).unwrap();
    let store = story.keeper.store();
    assert_eq!(store.contacts("a", 9).unwrap().len(), 1);
    assert_eq!(
        store.incidents(None, 9).unwrap()[0].severity,
        Severity::Critical
    );
}
