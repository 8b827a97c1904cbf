//! Files without end are refused, or read as far as the limit.

#![allow(clippy::unwrap_used, reason = "only tests are in here")]

use std::fs;

use tauscope_archive::Recording;

#[test]
fn an_archive_of_all_channels_there_can_be_is_bounded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    for n in 0..65_000 {
        let none = std::collections::BTreeMap::new();
        writer
            .add_channel(0, &format!("/{n}"), "cdr", &none)
            .unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let recording = Recording::open(&path).unwrap();
    assert!(recording.topics().len() <= 4096);
    let told = recording.damage().last().unwrap().to_string();
    assert!(
        told.contains("more than 4096 channels, which is the limit"),
        "{told}"
    );
}

#[test]
fn a_view_in_the_place_of_a_table_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.db3");
    let database = rusqlite::Connection::open(&path).unwrap();
    database
        .execute_batch(
            "CREATE TABLE topics (id INTEGER, name TEXT, type TEXT, serialization_format TEXT);
             CREATE VIEW messages (id, topic_id, timestamp, data) AS
             WITH RECURSIVE endless (n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM endless)
             SELECT n, 1, n, x'00' FROM endless;",
        )
        .unwrap();
    drop(database);
    let refused = Recording::open(&path).map(|_| ()).unwrap_err().to_string();
    assert!(refused.contains("`messages` is a view"), "{refused}");
}
