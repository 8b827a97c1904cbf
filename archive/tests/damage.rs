//! Files that are torn, broken, or lie.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use std::fs::{self, OpenOptions};
use std::io::{Cursor, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::common::{Copied, read_all, state, write};
use mcap::records::{MessageHeader, Metadata};
use proptest::prelude::*;
use tauscope_archive::ros::{self, JointState, Message};
use tauscope_archive::{
    ArchiveError, Compression, DamageKind, Recording, RepairError, repair, repaired_path,
};

/// A small file as some other writer would leave it.
fn foreign(path: &Path, options: mcap::WriteOptions, count: i64) {
    let mut bytes = Vec::new();
    let mut writer = options
        .profile("ros2")
        .library("another")
        .compression_threads(0)
        .create(Cursor::new(&mut bytes))
        .unwrap();
    let schema = writer
        .add_schema(
            JointState::TYPE,
            "ros2msg",
            JointState::definition().as_bytes(),
        )
        .unwrap();
    let channel = writer
        .add_channel(schema, "/joint_states", "cdr", &[].into())
        .unwrap();
    for i in 0..count {
        let mut body = Vec::new();
        ros::encode(&state(i), &mut body).unwrap();
        // Pairs come the wrong way round.
        let log_time = 1000 + (i ^ 1) as u64;
        let header = MessageHeader {
            channel_id: channel,
            sequence: i as u32,
            log_time,
            publish_time: log_time,
        };
        writer.write_to_known_channel(&header, &body).unwrap();
        if i % 7 == 6 {
            writer.flush().unwrap();
        }
    }
    writer
        .attach(&mcap::Attachment {
            log_time: 1,
            create_time: 2,
            name: "notes.txt".to_owned(),
            media_type: "text/plain".to_owned(),
            data: b"some notes".as_slice().into(),
        })
        .unwrap();
    writer
        .write_metadata(&Metadata {
            name: "about".to_owned(),
            metadata: [("arm".to_owned(), "left".to_owned())].into(),
        })
        .unwrap();
    writer.finish().unwrap();
    drop(writer);
    fs::write(path, bytes).unwrap();
}

/// One small file of every kind.
fn kinds(folder: &Path) -> Vec<PathBuf> {
    let mut paths = Vec::new();
    for (name, compression) in [
        ("zstd", Compression::Zstd),
        ("lz4", Compression::Lz4),
        ("none", Compression::None),
    ] {
        paths.push(write(&folder.join(format!("{name}.mcap")), compression, 21));
    }
    let options = mcap::WriteOptions::new;
    for (name, options) in [
        ("plain", options().use_chunks(false)),
        ("large_chunks", options().chunk_size(None).compression(None)),
        (
            "no_index",
            options()
                .emit_summary_records(false)
                .emit_message_indexes(false),
        ),
        ("no_message_index", options().emit_message_indexes(false)),
        (
            "no_crc",
            options()
                .calculate_chunk_crcs(false)
                .calculate_summary_section_crc(false),
        ),
    ] {
        let path = folder.join(format!("{name}.mcap"));
        foreign(&path, options, 21);
        paths.push(path);
    }
    paths
}

/// The bytes of one small file of every kind.
static KINDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let paths = kinds(folder.path());
    paths.iter().map(|path| fs::read(path).unwrap()).collect()
});

/// Whether `part` is what is left of `whole` if messages are taken away, but not changed or moved.
fn is_left_of(part: &[Copied], whole: &[Copied]) -> bool {
    let mut rest = whole.iter();
    part.iter()
        .all(|message| rest.any(|other| other == message))
}

#[test]
fn files_of_every_kind_are_read_in_order_of_time() {
    let folder = tempfile::tempdir().unwrap();
    for path in kinds(folder.path()) {
        let recording = Recording::open(&path).unwrap();
        assert!(recording.damage().is_empty(), "{:?}", recording.damage());
        let (messages, damaged) = read_all(&recording);
        assert_eq!(damaged, 0);
        assert_eq!(messages.len() as u64, recording.message_count());
        assert!(messages.len() >= 21);
        assert!(
            messages.is_sorted_by_key(|message| message.log_time_ns),
            "{path:?}"
        );
    }
}

#[test]
fn a_file_cut_at_any_byte_is_read_up_to_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    for path in kinds(folder.path()) {
        let name = path.file_name().unwrap().to_owned();
        let (whole, _) = read_all(&Recording::open(&path).unwrap());
        let file = OpenOptions::new().write(true).open(&path).unwrap();
        let mut last = whole.len();
        let mut header_reached = true;
        for cut in (0..fs::metadata(&path).unwrap().len()).rev() {
            file.set_len(cut).unwrap();
            let recording = match Recording::open(&path) {
                Ok(recording) => recording,
                Err(ArchiveError::Unreadable { .. } | ArchiveError::UnknownFormat { .. }) => {
                    header_reached = false;
                    continue;
                }
                Err(error) => panic!("{name:?} cut at {cut}: {error}"),
            };
            assert!(header_reached, "{name:?} at {cut}: readable again");
            assert!(!recording.damage().is_empty(), "{name:?} cut at {cut}");
            let (read, damaged) = read_all(&recording);
            assert_eq!(damaged, 0, "{name:?} cut at {cut}");
            assert!(is_left_of(&read, &whole), "{name:?} cut at {cut}");
            assert_eq!(read.len() as u64, recording.message_count());
            assert!(read.len() <= last, "{name:?} cut at {cut}");
            last = read.len();
        }
        assert!(!header_reached);
        assert_eq!(last, 0);
    }
}

#[test]
fn a_torn_chunk_gives_what_lies_before_the_tear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    foreign(&path, mcap::WriteOptions::new().compression(None), 21);
    let bytes = fs::read(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let last = &summary.chunk_indexes[2];
    let cut = last.chunk_start_offset + last.chunk_length - 10;
    fs::write(&path, &bytes[..cut as usize]).unwrap();
    let recording = Recording::open(&path).unwrap();
    // All but the last message of the last chunk.
    assert_eq!(read_all(&recording).0.len(), 20);
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert_eq!(damage.kind, DamageKind::TornTail);
    assert_eq!(damage.at, last.chunk_start_offset);
    assert_eq!(damage.readable_until_ns, Some(1019));
}

#[test]
fn a_broken_chunk_is_told_and_the_rest_is_read() {
    let folder = tempfile::tempdir().unwrap();
    for (name, compression) in [
        ("zstd", Compression::Zstd),
        ("lz4", Compression::Lz4),
        ("none", Compression::None),
    ] {
        let path = write(&folder.path().join(name), compression, 50);
        let (whole, _) = read_all(&Recording::open(&path).unwrap());
        let bytes = fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let chunk = &summary.chunk_indexes[2];
        let middle = chunk.chunk_start_offset + chunk.chunk_length / 2;
        let mut file = OpenOptions::new().write(true).open(&path).unwrap();
        file.seek(SeekFrom::Start(middle)).unwrap();
        file.write_all(&[!bytes[middle as usize]]).unwrap();

        let recording = Recording::open(&path).unwrap();
        assert!(recording.damage().is_empty(), "the index is sound");
        let mut messages = recording.all_messages().unwrap();
        let mut read = 0;
        let mut told = Vec::new();
        while let Some(message) = messages.next_message() {
            match message {
                Ok(_) => read += 1,
                Err(error) => told.push((read, error.damage().unwrap().clone())),
            }
        }
        // The chunks hold ten joint states and a flag each.
        assert_eq!((whole.len(), read), (55, 44));
        let [(22, damage)] = told.as_slice() else {
            panic!("{told:?}");
        };
        assert_eq!(damage.at, chunk.chunk_start_offset);
        assert_eq!(damage.readable_until_ns, Some(whole[21].log_time_ns));
        let DamageKind::Chunk {
            start_ns, end_ns, ..
        } = damage.kind
        else {
            panic!("{damage}");
        };
        assert_eq!(start_ns, Some(chunk.message_start_time as i64));
        assert_eq!(end_ns, Some(chunk.message_end_time as i64));
    }
}

#[test]
fn a_broken_index_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 50);
    let (whole, _) = read_all(&Recording::open(&path).unwrap());
    let mut bytes = fs::read(&path).unwrap();
    let in_the_index = bytes.len() - 100;
    bytes[in_the_index] ^= 0x55;
    fs::write(&path, bytes).unwrap();
    let recording = Recording::open(&path).unwrap();
    let [damage] = recording.damage() else {
        panic!("{:?}", recording.damage());
    };
    assert!(matches!(damage.kind, DamageKind::Index { .. }));
    assert!(!damage.loses_data());
    assert_eq!(read_all(&recording).0, whole);
}

#[test]
fn topics_that_are_not_as_wanted_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 1);
    let recording = Recording::open(&path).unwrap();
    let error = |topic| match recording.joint_states(topic) {
        Ok(_) => panic!("{topic}"),
        Err(error) => error.to_string(),
    };
    assert!(error("/x").ends_with("no topic \"/x\"; it has /joint_states, /contact"));
    assert!(error("/contact").ends_with(
        "topic \"/contact\" carries std_msgs/msg/Bool as \"cdr\", expected \
         sensor_msgs/msg/JointState or control_msgs/msg/DynamicJointState as \"cdr\""
    ));
    let path = write(&folder.path().join("a.mcap"), Compression::Zstd, 0);
    assert!(matches!(
        Recording::open(path).unwrap().joint_states("/joint_states"),
        Err(ArchiveError::Empty { known, .. }) if known.len() == 2
    ));
}

#[test]
fn a_message_that_is_not_what_its_topic_says_is_told_and_passed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let mut bytes = Vec::new();
    let mut writer = mcap::Writer::new(Cursor::new(&mut bytes)).unwrap();
    let schema = writer.add_schema(JointState::TYPE, "ros2msg", b"").unwrap();
    let channel = writer.add_channel(schema, "/j", "cdr", &[].into()).unwrap();
    for (log_time, cut) in [(1, 0), (2, 5), (3, 0)] {
        let mut body = Vec::new();
        ros::encode(&state(1), &mut body).unwrap();
        body.truncate(body.len() - cut);
        let header = MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time,
            publish_time: log_time,
        };
        writer.write_to_known_channel(&header, &body).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    fs::write(&path, bytes).unwrap();
    let recording = Recording::open(&path).unwrap();
    let mut states = recording.joint_states("/j").unwrap();
    assert!(states.next_state().unwrap().is_ok());
    let error = states.next_state().unwrap().unwrap_err().to_string();
    assert!(
        error.contains("topic \"/j\", log time 0.000000002 s"),
        "{error}"
    );
    assert!(states.next_state().unwrap().is_ok());
    assert!(states.next_state().is_none());
}

#[test]
fn a_repaired_file_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    for path in kinds(folder.path()) {
        let bytes = fs::read(&path).unwrap();
        let torn = path.with_extension("mcap.part");
        fs::write(&torn, &bytes[..bytes.len() * 4 / 5]).unwrap();
        let (before, _) = read_all(&Recording::open(&torn).unwrap());
        let to = repaired_path(&torn);
        assert_eq!(to, repaired_path(&path));
        let repaired = repair(&[&torn], &to).unwrap();
        assert!(!repaired.damage.is_empty(), "{path:?}");
        assert_eq!(repaired.written.messages as usize, before.len());
        let recording = Recording::open(&to).unwrap();
        assert!(recording.damage().is_empty());
        assert_eq!(read_all(&recording).0, before);
        assert!(recording.metadata().contains_key("tauscope_repair"));
        assert!(matches!(
            repair(&[&torn], &to),
            Err(RepairError::Exists { .. })
        ));
    }
}

#[test]
fn a_repair_keeps_metadata_attachments_and_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    foreign(&path, mcap::WriteOptions::new(), 21);
    // Only the end is missing.
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() - 30]).unwrap();
    let to = folder.path().join("b.mcap");
    repair(&[&path], &to).unwrap();
    let bytes = fs::read(&to).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.attachment_indexes.len(), 1);
    let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    assert_eq!(attachment.data.as_ref(), b"some notes");
    let recording = Recording::open(&to).unwrap();
    assert_eq!(recording.metadata()["about"]["arm"], "left");
    let sequences: Vec<_> = mcap::MessageStream::new(&bytes)
        .unwrap()
        .map(|message| message.unwrap().sequence)
        .collect();
    assert_eq!(sequences, (0..21).collect::<Vec<_>>());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Nothing that stands in a file may make the reader panic, or take memory without end.
    #[test]
    fn no_damage_makes_it_panic(
        kind in 0..8_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
        wide in prop::option::of((any::<prop::sample::Index>(), any::<u64>())),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut bytes = KINDS[kind].clone();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some((at, value)) = wide {
            let at = at.index(bytes.len() - 8);
            bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        fs::write(&path, bytes).unwrap();
        if let Ok(recording) = Recording::open(&path) {
            // With a wrong index the counts may differ from the messages read, but reading ends.
            let mut messages = recording.all_messages().unwrap();
            while let Some(message) = messages.next_message() {
                if let Ok(message) = message {
                    let _ = message.decode::<JointState>();
                }
            }
            let _ = repair(&[&path], &folder.path().join("repaired.mcap"));
        }
    }
}
