//! The pieces of a recorder that died several times become one file, and a folder of them a bag.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use tauscope_archive::ros::{Header, JointState, WrenchStamped};
use tauscope_archive::{
    Compression, McapWriter, Recording, RecordingKind, RepairError, repair, repair_folder,
    repair_in_place, repaired_folder_path,
};

/// Joint states number `range`, one each 10 ms, on a topic that is not the first of each file.
fn written(path: &Path, range: std::ops::Range<i64>, made_by: &str) -> PathBuf {
    let provenance = BTreeMap::from([("made_by".to_owned(), made_by.to_owned())]);
    let mut writer = McapWriter::create(path, Compression::Zstd, &provenance).unwrap();
    if range.start == 0 {
        writer.add_topic::<WrenchStamped>("/wrench").unwrap();
    }
    let topic = writer.add_topic::<JointState>("/joint_states").unwrap();
    for k in range {
        let ns = 1_000_000_000 + k * 10_000_000;
        let state = JointState {
            header: Header::new(ns, ""),
            name: vec!["elbow".to_owned()],
            position: vec![],
            velocity: vec![],
            effort: vec![k as f64],
        };
        writer.write(topic, ns, ns, &state).unwrap();
    }
    writer.finish().unwrap().path
}

/// Writes such a file truncated before its end.
fn torn(path: &Path, range: std::ops::Range<i64>) -> PathBuf {
    let whole = written(&path.with_extension("whole"), range, "us");
    let bytes = fs::read(&whole).unwrap();
    fs::remove_file(&whole).unwrap();
    fs::write(path, &bytes[..bytes.len() * 3 / 4]).unwrap();
    path.to_owned()
}

fn efforts(path: &Path) -> Vec<f64> {
    let recording = Recording::open(path).unwrap();
    assert!(recording.damage().is_empty(), "{:?}", recording.damage());
    let mut states = recording.joint_states("/joint_states").unwrap();
    let mut efforts = Vec::new();
    while let Some(state) = states.next_state() {
        efforts.push(state.unwrap().message.effort[0]);
    }
    efforts
}

#[test]
fn pieces_are_joined_in_the_order_of_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let pieces = [
        written(&at("a.mcap"), 400..500, "us"),
        torn(&at("a.2.mcap.part"), 200..400),
        torn(&at("a.1.mcap.part"), 0..200),
    ];
    let to = at("joined.mcap");
    let repaired = repair(&pieces, &to).unwrap();
    assert_eq!(repaired.from, [2, 1, 0].map(|i: usize| pieces[i].clone()));
    assert_eq!(repaired.damage.len(), 2, "two were torn");
    let all = efforts(&to);
    assert_eq!(all.len() as u64, repaired.written.messages);
    assert!(all.is_sorted() && all.len() > 250, "{}", all.len());
    assert_eq!(all[all.len() - 100..].first(), Some(&400.0));
    // The metadata that rosbag2 reads instead of a `metadata.yaml`.
    let recording = Recording::open(&to).unwrap();
    let bag = &recording.metadata()["rosbag2"]["serialized_metadata"];
    assert!(
        bag.contains(&format!("message_count: {}", all.len())),
        "{bag}"
    );
    assert!(bag.contains("joined.mcap"), "{bag}");
}

#[test]
fn a_folder_becomes_a_bag_of_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    fs::create_dir(&out).unwrap();
    torn(&out.join("a.1.mcap.part"), 0..200);
    written(&out.join("a.mcap"), 200..300, "us");
    written(&out.join("b.mcap"), 300..400, "us");
    fs::write(out.join("c.mcap"), "nothing that can be read").unwrap();
    let before = fs::read(out.join("a.1.mcap.part")).unwrap();
    let to = repaired_folder_path(&out);
    assert_eq!(to, folder.path().join("out.repaired"));
    let bag = repair_folder(&out, &to).unwrap();
    assert_eq!(bag.damage.len(), 1, "{:?}", bag.damage);
    let names: Vec<_> = bag
        .files
        .iter()
        .map(|file| file.written.path.clone())
        .collect();
    assert_eq!(names, ["a.mcap", "b.mcap"].map(|name| to.join(name)));

    let recording = Recording::open(&to).unwrap();
    assert_eq!(recording.kind(), RecordingKind::Rosbag2);
    assert!(recording.damage().is_empty(), "{:?}", recording.damage());
    let messages: u64 = bag.files.iter().map(|file| file.written.messages).sum();
    assert_eq!(recording.message_count(), messages);
    let all = efforts(&to);
    assert!(all.is_sorted() && all.len() as u64 == messages);
    let metadata = fs::read_to_string(to.join("metadata.yaml")).unwrap();
    assert!(
        metadata.contains(&format!("message_count: {messages}")),
        "{metadata}"
    );
    // The old folder is as it was, and the new one is not replaced.
    assert_eq!(fs::read(out.join("a.1.mcap.part")).unwrap(), before);
    let again = repair_folder(&out, &to);
    assert!(
        matches!(again, Err(RepairError::Exists { .. })),
        "{again:?}"
    );
}

#[test]
fn a_torn_file_is_replaced_by_its_repaired_one_only_if_all_of_it_was_read() {
    let folder = tempfile::tempdir().unwrap();
    let part = torn(&folder.path().join("a.1.mcap.part"), 0..200);
    let repaired = repair_in_place(&part).unwrap();
    assert_eq!(repaired.written.path, folder.path().join("a.1.mcap"));
    assert!(!part.exists());
    assert_eq!(
        efforts(&repaired.written.path).len() as u64,
        repaired.written.messages
    );

    let part = torn(&folder.path().join("b.mcap.part"), 0..200);
    let mut bytes = fs::read(&part).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0xff;
    fs::write(&part, bytes).unwrap();
    let repaired = repair_in_place(&part).unwrap();
    assert!(repaired.written.path.exists(), "{:?}", repaired.damage);
    // It stays by another name: the next start would repair it once more, into one more file.
    let aside = folder.path().join("b.mcap.damaged");
    assert_eq!(repaired.set_aside.as_ref(), Some(&aside));
    assert!(aside.exists() && !part.exists());
}

#[test]
fn what_is_being_written_is_not_repaired() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let _writer = McapWriter::create(&path, Compression::Zstd, &BTreeMap::new()).unwrap();
    let part = folder.path().join("a.mcap.part");
    let refused = repair_in_place(&part).unwrap_err();
    assert!(
        matches!(refused, RepairError::BeingWritten { .. }),
        "{refused}"
    );
    let refused = repair(&[&part], &folder.path().join("b.mcap")).unwrap_err();
    assert!(
        refused.to_string().contains("still writing it"),
        "{refused}"
    );
}
